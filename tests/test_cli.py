# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line as people meet it: every mistake is one clear line and the right exit code."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest

from generator import cli
from generator.cli import app
from generator.execution.lanes import renderer
from generator.execution.stopping import Stopped


def headturn(*arguments: str | Path, monkeypatch: pytest.MonkeyPatch) -> int:
    """Run the command in this process; its exit code."""
    monkeypatch.setattr(sys, "argv", ["headturn", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return stopped.value.code or 0


COMMANDS = [
    *([], ["heads"], ["heads", "make"], ["heads", "list"], ["build"], ["verify"], ["preview"]),
    *(["export"], ["report"], ["compact"], ["replay"], ["upgrade"], ["doctor"]),
]


@pytest.mark.parametrize("command", [c for c in COMMANDS if c not in ([], ["heads"])], ids=" ".join)
def test_every_command_has_help_with_an_example(
    command: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    assert headturn(*command, "--help", monkeypatch=monkeypatch) == 0
    assert f"Example: headturn {' '.join(command)}" in re.sub(r"\s+", " ", capsys.readouterr().out)


BAD = {
    "missing configuration": (
        ["build", "nowhere.toml"],
        2,
        "nowhere.toml: there is no such configuration file",
    ),
    "missing heads": (["build", "--heads", "nowhere"], 2, "nowhere"),
    "empty heads": (["build", "--heads", "empty"], 2, "empty"),
    "step does not divide": (["build", "--yaw=-50,50,30"], 2, "yaw"),
    "negative step": (["build", "--pitch=-40,40,-10"], 2, "pitch"),
    "not a number": (["build", "--yaw=a,b,c"], 2, "--yaw 'a,b,c'"),
    "two numbers for a grid": (["build", "--yaw=-50,50"], 2, "poses.yaw"),
    "one number for random poses": (["build", "--poses", "uniform:5", "--yaw=10"], 2, "poses.yaw"),
    "a step for random poses": (["build", "--poses", "sobol:5", "--yaw=-9,9,3"], 2, "low and high"),
    "half a light": (["build", "--light", "20"], 2, "--light '20': expected 2 numbers, such as 25,35"),
    "unknown executor": (["build", "--executor", "cloud"], 2, "expected one of serial, local, ray"),
    "parametric with an argument": (["build", "--heads", "parametric:x"], 2, "parametric:x"),
    "ict without a folder": (
        ["build", "--heads", "ict:"],
        2,
        "--heads ict: names no folder; give that of ICT",
    ),
    "ict of nothing": (["build", "--heads", "ict:nowhere"], 2, "nowhere: no such folder; give that of ICT"),
    "ict of an empty folder": (["heads", "make", "--source", "ict:empty", "--out", "h"], 2, "FaceXModel"),
    "a source that is none": (["heads", "make", "--source", "flame", "--out", "h"], 2, "parametric, ict"),
    "unknown images": (["build", "--images", "tape"], 2, "dataset.images"),
    "resolution": (["build", "--resolution", "4"], 2, "render.resolution"),
    "sobol without a count": (["build", "--poses", "sobol"], 2, "sobol:500"),
    "missing pose file": (["build", "--poses", "poses.csv"], 2, "poses.csv"),
    "no such blender": (["build", "--blender", "/nowhere/blender"], 2, "/nowhere/blender"),
    "address without ray": (["build", "--address", "auto"], 2, "--address is for --executor ray"),
    "preview a pose of two": (["preview", "empty", "--pose", "1,2"], 2, "--pose '1,2'"),
    "preview to a text file": (["preview", "empty", "--out", "a.txt"], 2, "a.txt"),
    "list nothing": (["heads", "list", "nowhere"], 2, "nowhere"),
    "make none": (["heads", "make", "--count", "0", "--out", "h"], 2, "0"),
}


@pytest.mark.parametrize(("arguments", "code", "says"), BAD.values(), ids=BAD.keys())
def test_bad_input_is_one_line(
    arguments: list[str],
    code: int,
    says: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture,
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    if arguments[0] == "preview":
        pytest.importorskip("cv2")
    # Nothing is rendered; whether there is a Blender would be told before what is tried here.
    monkeypatch.setattr(renderer, "find_spec", lambda name: ModuleSpec(name, None))
    if arguments[0] == "build":
        arguments = [*arguments, "--out", "dataset"]
    assert headturn(*arguments, monkeypatch=monkeypatch) == code
    printed = capsys.readouterr()
    lines = [line for line in printed.err.splitlines() if line.startswith("headturn: ")]
    assert len(lines) == 1, printed.err
    assert says in lines[0]
    assert "Traceback" not in printed.err
    assert not (tmp_path / "dataset" / "manifest.json").exists()


def test_verify_of_nothing(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture) -> None:
    assert headturn("verify", "nowhere", monkeypatch=monkeypatch) == 1
    failed = [line for line in capsys.readouterr().out.splitlines() if line.startswith("FAIL")]
    assert len(failed) == 1
    assert "nowhere" in failed[0]


@pytest.mark.parametrize(
    "text", ["[render\n", "[render]\nresolution = 'big'\n", "[rendering]\nx = 1\n", "heads = 3\n"]
)
def test_bad_configuration_names_the_file(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    file = tmp_path / "c.toml"
    file.write_text(text)
    assert headturn("build", file, "--out", tmp_path / "d", monkeypatch=monkeypatch) == 2
    assert str(file) in capsys.readouterr().err


def test_build_from_toml_and_flags_as_a_person_would(parametric_heads: Path, tmp_path: Path) -> None:
    """The console entry point in a process of its own, JSON events, verify, and a second run."""
    (tmp_path / "c.toml").write_text(
        f'[heads]\nsource = "{parametric_heads}"\nsubjects = ["s1p0001"]\n'
        "[poses]\nyaw = [-20, 20, 20]\npitch = [0, 0, 1]\nroll = [0, 0, 1]\n[render]\nresolution = 256\n"
    )
    command = [sys.executable, "-m", "generator.cli"]
    build = [*command, "build", "c.toml", "--resolution", "80", "--out", "d", "--json"]
    done = subprocess.run(build, cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    events = [json.loads(line) for line in done.stdout.splitlines()]
    assert events[-1]["event"] == "finished"
    assert events[-1]["rows"] == 3
    assert "resolution = 80" in (tmp_path / "d" / "config.toml").read_text()
    verify = subprocess.run([*command, "verify", "d", "--json"], cwd=tmp_path, capture_output=True, text=True)
    assert verify.returncode == 0, verify.stdout
    again = subprocess.run(build, cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert json.loads(again.stdout.splitlines()[-1])["digest"] == events[-1]["digest"]


def test_preview_writes_one_picture(
    parametric_heads: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    picture = tmp_path / "p.png"
    head = parametric_heads / "s1p0000"
    options = ["--pose", "30,10,0", "--preset", "fast", "--resolution", "128", "--out", picture]
    assert headturn("preview", head, *options, monkeypatch=monkeypatch) == 0
    assert "landmarks found" in capsys.readouterr().out
    assert picture.stat().st_size > 3000
    copy = tmp_path / "copy"
    shutil.copytree(head, copy)
    (copy / "head.json").unlink()
    with (copy / "neutral.obj").open("a") as mesh:
        mesh.write("usemtl nothing\nf 1 2 3\n")
    assert headturn("preview", copy / "neutral.obj", *options, monkeypatch=monkeypatch) == 0
    said = capsys.readouterr().out
    assert "licence unknown" in said and "'nothing' is not in the material file" in said
    several = headturn("preview", parametric_heads, "--out", picture, monkeypatch=monkeypatch)
    assert several == 2
    assert "2 subjects" in capsys.readouterr().err


def test_a_build_needs_nothing_but_the_build_extra(parametric_heads: Path, tmp_path: Path) -> None:
    """Packages of the test tools and of the learning side are hidden; build and verify work."""
    program = """
import sys

class Hidden:
    def find_spec(self, name, path=None, target=None):
        if name in ("pandas", "polars", "duckdb", "datasets", "torch", "psutil", "pytest"):
            raise ModuleNotFoundError(name)

sys.meta_path.insert(0, Hidden())
from generator.cli.app import main
main()
"""
    python = [sys.executable, "-c", program]
    poses = ["--yaw=0,0,1", "--pitch=0,0,1", "--roll=0,0,1", "--resolution", "64", "--executor", "serial"]
    build = [*python, "build", "--heads", str(parametric_heads), *poses, "--out", "d"]
    done = subprocess.run(build, cwd=tmp_path, capture_output=True, text=True, timeout=200)
    assert done.returncode == 0, done.stderr
    done = subprocess.run([*python, "verify", "d"], cwd=tmp_path, capture_output=True, text=True, timeout=100)
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_one_interrupt_is_enough_while_it_starts(parametric_heads: Path, tmp_path: Path) -> None:
    """numpy took it for a missing module, and others did without what they imported."""
    program = "print('go', flush=True)\nfrom generator.cli import main\nmain()"
    build = [sys.executable, "-c", program, "build", "--heads", str(parametric_heads), "--resolution", "64"]
    for moment in range(10):
        with subprocess.Popen(
            [*build, "--out", str(tmp_path / str(moment))],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        ) as started:
            assert started.stdout is not None
            started.stdout.readline()
            time.sleep(0.15 + 0.2 * moment)
            started.send_signal(signal.SIGINT)
            try:
                _, said = started.communicate(timeout=30)
            finally:
                started.kill()
        assert (started.returncode, "Traceback" in said) == (130, False), said
        assert said.endswith("headturn: stopped by SIGINT; run the same command again to continue\n")


def test_a_program_that_calls_a_command_keeps_its_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "relative")
    before, path = dict(os.environ), sys.path[:]
    assert headturn("--version", monkeypatch=monkeypatch) == 0
    assert (dict(os.environ), sys.path) == (before, path)


def test_listing_a_head_that_cannot_be_read_is_told_to_scripts(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    (tmp_path / "fine.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "broken.obj").write_text("v 0 0 0\nf 1 2 3\n")
    assert headturn("heads", "list", tmp_path, "--json", monkeypatch=monkeypatch) == 3
    rows = {Path(row["path"]).name: row for row in json.loads(capsys.readouterr().out)["heads"]}
    assert (rows["broken.obj"]["skipped"], rows["fine.obj"]["skipped"]) == (True, False)
    assert headturn("heads", "list", tmp_path / "fine.obj", monkeypatch=monkeypatch) == 0


@pytest.mark.parametrize(("line", "further"), [("build x", True), ("verify x", False), ("heads make", False)])
def test_only_what_goes_on_is_said_to(
    line: str, further: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop() -> None:
        raise Stopped(signal.SIGINT)

    monkeypatch.setattr(app, "main", stop)
    assert headturn(*line.split(), monkeypatch=monkeypatch) == 130
    again = "; run the same command again to continue" if further else ""
    assert capsys.readouterr().err == f"headturn: stopped by SIGINT{again}\n"
