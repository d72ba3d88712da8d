# SPDX-License-Identifier: GPL-3.0-or-later
"""Terminals and locales that lack the characters of a path, and installations that lack an extra."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

ASCII = {"PYTHONIOENCODING": "ascii"}
OLD_C = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
"""Where no path but ASCII's is text."""

COMMANDS = {
    "headturn": (
        "verify {}/d",
        "verify {}/nowhere",
        "report {}/d",
        "export {}/d --format coco --out {}/coco",
        "compact {}/d --out {}/compact",
        "upgrade {}/d",
        "replay {}/d s1/neutral/y+0_p+0_r+1",
        "heads list {}",
        "preview {}",
        "build --heads {} --out {}/e",
        "build --heads {}/nowhere --out {}/d",
        "build {}/config.toml --out {}/d",
    ),
    "downstream-hpe": (
        "predict {}/nowhere.png",
        "evaluate headturn {}/d",
        "fit {}/d --out {}/model",
        "export {}/m",
    ),
}


ALONE = "from {package}.cli import main\nmain()\n"


def run(program: str, *arguments: bytes | str, code: str = ALONE, hidden: str = "", **environment: str):
    package = {"headturn": "generator", "downstream-hpe": "downstream_hpe"}[program]
    hide = f"import sys\nfor name in {hidden.split()!r}:\n    sys.modules[name] = None\n"
    return subprocess.run(
        [sys.executable, "-c", hide + code.format(package=package, program=program), *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        stdin=subprocess.DEVNULL,
        timeout=120,
    )


ONE_BY_ONE = """
import os, sys
from {package}.cli import main
lines, line = [], []
for word in sys.argv[1:]:
    if word == ";":
        lines.append(line)
        line = []
    else:
        line.append(word)
for line in lines:
    sys.argv = ["{program}", *line]
    code = 0
    try:
        main()
    except SystemExit as stopped:
        code = stopped.code or 0
    sys.stdout.flush()
    sys.stderr.flush()
    os.write(2, b"\\x1e%d\\x1e" % code)
"""
"""Runs command after command, each of which ends with ";": starting is most of what one takes."""


def all_said(folder: Path, name: bytes, program: str, lines: Sequence[str], **environment: str) -> bytes:
    """What commands said of a folder of that name, each of which gave an answer."""
    place = os.fsencode(folder) + b"/" + name
    words = [os.fsencode(word).replace(b"{}", place) for line in lines for word in (*line.split(), ";")]
    done = run(program, *words, code=ONE_BY_ONE, **environment)
    assert done.returncode == 0, done.stderr
    *answers, rest = done.stderr.split(b"\x1e")
    assert not rest and len(answers) == 2 * len(lines), done.stderr
    for line, text, code in zip(lines, answers[::2], answers[1::2], strict=True):
        assert b"Traceback" not in text and b"PYTHONIOENCODING" not in text, text
        assert code in (b"0", b"1", b"2", b"3"), (line, code)
        if code in (b"1", b"2") and not line.startswith("verify"):
            assert text.splitlines()[-1].startswith(program.encode() + b": "), (line, text)
    return done.stdout + done.stderr


@pytest.mark.parametrize("environment", [ASCII, OLD_C], ids=["ascii", "old C"])
@pytest.mark.parametrize(
    ("program", "line"), [("headturn", "heads list {}/nowhere"), ("downstream-hpe", "predict {}/nowhere.png")]
)
def test_a_path_that_cannot_be_shown(tmp_path: Path, program: str, line: str, environment: dict) -> None:
    assert b"w\\" in all_said(tmp_path, "wörld".encode(), program, [line], **environment)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names are text")
@pytest.mark.parametrize(
    ("name", "environment"),
    [("wörld 头 (1)".encode(), ASCII), ("wörld".encode(), OLD_C), (b"no \xff text", {})],
    ids=["unicode in ascii", "unicode in an old C", "bytes"],
)
def test_every_command(dataset: Path, tmp_path: Path, name: bytes, environment: dict) -> None:
    folder = os.fsencode(tmp_path) + b"/" + name
    os.mkdir(folder)
    shutil.move(os.fsencode(dataset), folder + b"/d")
    with open(folder + b"/config.toml", "w") as file:
        file.write("[poses]\nyaw = 'no'\n")
    for program, lines in COMMANDS.items():
        all_said(tmp_path, name, program, lines, **environment)


WITHOUT = {
    "cv2 mediapipe trimesh embreex OpenEXR bpy ray": ("headturn", "[build]"),
    "torch onnx onnxruntime safetensors mediapipe cv2": ("downstream-hpe", "pip install "),
}


@pytest.mark.slow
@pytest.mark.parametrize("hidden", WITHOUT)
def test_an_extra_that_is_missing_is_one_line(dataset: Path, tmp_path: Path, hidden: str) -> None:
    program, extra = WITHOUT[hidden]
    (tmp_path / "heads").mkdir()
    (tmp_path / "heads" / "a.glb").write_bytes(b"glTF")
    (tmp_path / "d2").symlink_to(dataset)
    missed = 0
    for line in (
        (
            *("build --heads {}/heads --out {}/e", "build --heads {}/heads --out {}/e --executor ray"),
            *(
                "preview {}/heads",
                "heads list {}/heads",
                "replay {}/d2 s1/neutral/y+0_p+0_r+0",
                "preview-server",
            ),
            *(
                "verify {}/d2",
                "report {}/d2",
                "export {}/d2 --format coco --out {}/c",
                "compact {}/d2 --out {}/m",
            ),
        )
        if program == "headturn"
        else (
            *("predict {}/d2/contact_sheet.png", "fit {}/d2 --out {}/m", "evaluate headturn {}/d2"),
            "export {}/m --onnx {}/a.onnx",
        )
    ):
        done = run(program, *line.replace("{}", str(tmp_path)).split(), hidden=hidden)
        text = done.stderr.decode()
        assert "Traceback" not in text, text
        needs = not line.startswith(("verify", "report", "export {}/d2", "compact"))
        assert (done.returncode != 0) == needs, text
        if needs:
            missed += extra in text
            assert text.count("\n") == 1 and text.startswith(f"{program}: "), text
    assert missed >= 3
