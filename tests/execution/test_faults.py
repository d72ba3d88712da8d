# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that can go wrong does; afterwards the dataset is the same as if nothing had."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest
from small_builds import ROOT, Host, Quiet, host, run

from generator.dataset.format.manifest import read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.errors import DatasetError
from generator.execution.build.folder import CONFIG_FILE
from generator.execution.build.lock import LOCK_FILE
from generator.execution.build.placed_heads import PLACED_FILE
from generator.execution.stopping import Stopped, stoppable
from generator.plan.config import BuildConfig
from generator.sealed import sealed_line, unsealed

Built = tuple[BuildConfig, Path]

KILLS = int(os.environ.get("HEADTURN_KILLS", "15"))
"""Kills of hosts and workers; `make soak` asks for 200."""

SEED = int(os.environ.get("HEADTURN_SEED", "0"))

TMPFS = Path("/dev/shm")


def leftovers(of: Host) -> list[str]:
    """Scratch folders of a build's processes."""
    return [path.name for path in TMPFS.glob(f"headturn-{of.process.pid}-*")] if TMPFS.is_dir() else []


def looked_at(built: Built, root: Path) -> Path:
    """A folder where the heads were prepared and nothing was rendered yet: what follows is quick."""
    root.mkdir()
    for name in (CONFIG_FILE, PLACED_FILE):
        shutil.copy(built[1] / name, root)
    return root


def check(root: Path, built: Built) -> None:
    """Verified, and the very rows of the undisturbed build."""
    report = verify_dataset(root)
    assert report.ok, report.text()
    assert read_manifest(root).digest == read_manifest(built[1]).digest
    assert not list((root / "data").rglob(".*")), "nothing half-written is left"


def test_killed_at_random_moments(built: Built, tmp_path: Path) -> None:
    """SIGKILL of the host or of one of its processes, again and again, until all kills are spent."""
    rng = random.Random(SEED)
    kills = {"host": 0, "lane": 0, "blender": 0}
    builds = 0
    while sum(kills.values()) < KILLS:
        root = tmp_path / f"dataset{builds}"
        if builds:
            looked_at(built, root)  # the first is also killed while it looks for faces
        builds += 1
        code = None
        while code != 0:
            with host(built[0], root, "--yes") as started:
                while started.process.poll() is None and sum(kills.values()) < KILLS:
                    time.sleep(rng.uniform(0.1, 4.0))
                    kill_one(started, rng, kills)
                code = started.wait()
                # 1: the same order's lanes were killed three times before anything was rendered.
                assert code in (0, 1, 3, -signal.SIGKILL), started.text()
                assert "Traceback" not in started.text()
                assert not started.orphans()
                if code != -signal.SIGKILL:
                    assert not leftovers(started)
        check(root, built)
        shutil.rmtree(root)
    print(f"{kills} in {builds} datasets")


def kill_one(started: Host, rng: random.Random, kills: dict[str, int]) -> None:
    """The host with a chance of one in three, else one of its workers, if it has any yet."""
    workers = started.workers()
    if rng.random() < 1 / 3:
        if started.process.poll() is None:
            started.process.kill()
            started.process.wait()
            kills["host"] += 1
        return
    if not workers:
        return
    victim = rng.choice(workers)
    try:
        kind = "blender" if "generator.blender.worker" in victim.cmdline() else "lane"
        victim.kill()
    except psutil.NoSuchProcess:
        return
    kills[kind] += 1


@pytest.fixture
def faulty(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """The path of a Blender that breaks at yaw 40, the last pose of each head."""
    script = tmp_path / "blender"
    source = Path(__file__).with_name("faulty_blender.py").read_text().splitlines()
    here = [f"#!{sys.executable}", "import sys", f"sys.path.insert(0, {str(ROOT)!r})"]
    body = "\n".join(line for line in source[1:] if "import annotations" not in line)
    script.write_text("\n".join(here) + "\n" + body + "\n")
    script.chmod(0o755)
    monkeypatch.setenv("FAULT_YAW", "40")
    return str(script)


@pytest.mark.parametrize(
    ("fault", "limits", "says"),
    [
        ("crash", {}, "killed by signal 11"),
        ("hang", {"deadline_s": 20.0}, "hung: no sign of life for 20 s"),
        ("grow", {"memory_mib": 1500.0}, "above its limit of 1500 MiB"),
    ],
)
def test_a_worker_that_breaks_is_replaced(
    fault: str, limits: dict, says: str, faulty: str, built: Built, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.setenv("FAULT", fault)
    monkeypatch.setenv("FAULT_ONCE", str(tmp_path / "happened"))
    reporter, root = Quiet(), looked_at(built, tmp_path / "d")
    result = run(built[0], root, reporter=reporter, lanes={"blender": faulty, **limits})
    assert (tmp_path / "happened").exists()
    assert result.complete
    assert sorted(facts["attempts"] for _, facts in reporter.events) == [1, 1, 1, 2]
    check(tmp_path / "d", built)


def test_a_unit_that_always_breaks_is_quarantined_and_built_once_it_can_be(
    faulty: str, built: Built, tmp_path: Path, monkeypatch
) -> None:
    monkeypatch.setenv("FAULT", "crash")
    root = looked_at(built, tmp_path / "d")
    with host(built[0], root, "--blender", faulty, "--json") as started:
        assert started.wait() == 3, started.text()
        finished = json.loads(started.text().splitlines()[-1])
        assert not started.orphans()
    assert (finished["rows"], finished["failed_units"]) == (8, 2)
    failures = [json.loads(line) for line in (root / "failures.jsonl").read_text().splitlines()]
    assert [failure["attempts"] for failure in failures] == [3, 3]
    for failure in failures:
        assert "killed by signal 11" in failure["reason"]
        assert any("this is the faulty pose" in line for line in failure["log"])
    assert not verify_dataset(root).ok
    assert run(built[0], root).complete
    assert not (root / "failures.jsonl").exists()
    check(root, built)


def test_a_lane_that_hangs_is_replaced(built: Built, tmp_path: Path) -> None:
    """SIGSTOP: alive, silent, deaf to everything but SIGKILL."""
    with host(built[0], looked_at(built, tmp_path / "d"), "--workers", "1", "--deadline", "8") as started:
        while not (lanes := started.workers("generator.execution.lanes.lane_main")):
            time.sleep(0.05)
        [lane] = lanes
        lane.suspend()
        assert started.wait() == 0, started.text()
        assert not started.orphans()
    check(tmp_path / "d", built)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_being_told_to_stop(number: signal.Signals, built: Built, tmp_path: Path) -> None:
    root = looked_at(built, tmp_path / "d")
    with host(built[0], root) as started:
        while not list(root.glob("data/*/part-*")):
            assert started.process.poll() is None, started.text()
            time.sleep(0.02)
        began = time.monotonic()
        started.process.send_signal(number)
        started.process.send_signal(number)  # an impatient second one changes nothing
        assert started.wait() == 128 + number, started.text()
        assert time.monotonic() - began < 5
        assert "run the same command again to continue" in started.text()
        assert "Traceback" not in started.text()
        assert not started.orphans()
        assert not leftovers(started)
    assert not (root / "manifest.json").exists()
    assert run(built[0], root).complete
    check(root, built)


def test_what_is_ignored_stays_ignored() -> None:
    """nohup ignores SIGHUP for whatever it starts; a build must not end with its terminal after all."""
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with stoppable():
            os.kill(os.getpid(), signal.SIGHUP)
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        with pytest.raises(Stopped) as stopped, stoppable():
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(5)
        assert stopped.value.exit_code == 143
    finally:
        signal.signal(signal.SIGHUP, before)


def cut_short(path: Path, rng: np.random.Generator) -> None:
    with path.open("r+b") as file:
        file.truncate(int(rng.integers(path.stat().st_size)))


def flip_a_bit(path: Path, rng: np.random.Generator) -> None:
    content = bytearray(path.read_bytes())
    content[rng.integers(len(content))] ^= 1 << int(rng.integers(8))
    path.write_bytes(content)


@pytest.mark.parametrize("damage", [cut_short, flip_a_bit])
def test_damaged_parts_are_built_again(damage, built: Built, tmp_path: Path) -> None:
    root = tmp_path / "d"
    shutil.copytree(built[1], root)
    parts = sorted(root.glob("data/*/*.parquet"))
    rng = np.random.default_rng(SEED)
    for part in parts[:3]:
        damage(part, rng)
    reporter = Quiet()
    run(built[0], root, reporter=reporter)
    assert reporter.stages["rendering"] <= 10
    check(root, built)


def test_a_full_disk_is_one_line_and_resumable(built: Built, tmp_path: Path) -> None:
    root = tmp_path / "small"
    root.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(root)]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("mounting a small tmpfs needs root")
    try:
        with host(built[0], root / "d") as started:
            assert started.wait() == 1, started.text()
            told = [line for line in started.text().splitlines() if line.startswith("headturn: ")]
            assert len(told) == 1, started.text()
            assert "No space left on device" in told[0]
            assert "Traceback" not in started.text()
            assert not started.orphans()
            assert not leftovers(started)
        subprocess.run(["mount", "-o", "remount,size=64m", str(root)], check=True)
        assert run(built[0], root / "d").complete
        check(root / "d", built)
    finally:
        subprocess.run(["umount", str(root)], check=True)


def test_two_builds_race_for_a_folder(built: Built, tmp_path: Path) -> None:
    root = looked_at(built, tmp_path / "d")
    with host(built[0], root) as one, host(built[0], root) as other:
        codes = sorted([one.wait(), other.wait()])
        assert codes == [0, 1], one.text() + other.text()
        loser = one if one.process.returncode else other
        assert "another build (process" in loser.text()
    check(root, built)
    assert not (root / LOCK_FILE).exists()


def test_a_lock_survives_neither_its_holder_nor_others_care(built: Built, tmp_path: Path) -> None:
    """The file a killed build left behind does not hold up the next."""
    root = tmp_path / "d"
    shutil.copytree(built[1], root)
    (root / LOCK_FILE).write_text("{not even json")
    assert run(built[0], root).complete
    with host(built[0], root) as started:
        while not (root / LOCK_FILE).exists():
            time.sleep(0.01)
        started.process.send_signal(signal.SIGSTOP)
        with pytest.raises(DatasetError, match="another build"):
            run(built[0], root)
        started.process.send_signal(signal.SIGCONT)
        assert started.wait() == 0, started.text()


def test_a_forged_placement_is_held_against_the_mesh(built: Built, tmp_path: Path) -> None:
    """By somebody who knows about checksums: the pivot moves and every landmark with it."""
    root = looked_at(built, tmp_path / "d")
    lines = []
    for line in (root / PLACED_FILE).read_text().splitlines():
        record = unsealed(json.loads(line))
        placement = record["receipt"]["placement"]
        placement["pivot"] = [value + 5.0 / placement["mm_per_unit"] for value in placement["pivot"]]
        lines.append(sealed_line(record))
    (root / PLACED_FILE).write_text("\n".join(lines) + "\n")
    with pytest.raises(DatasetError, match="no unit could be built"):
        run(built[0], root)
    reasons = [json.loads(line)["reason"] for line in (root / "failures.jsonl").read_text().splitlines()]
    assert reasons and all("of its anchors are not on its surface" in reason for reason in reasons)
    (root / PLACED_FILE).unlink()
    assert run(built[0], root).complete
    check(root, built)
