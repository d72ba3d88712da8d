# SPDX-License-Identifier: GPL-3.0-or-later
"""Terminals and locales that lack the characters of a path, and installations that lack an extra."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
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


def run(program: str, *arguments: bytes | str, hidden: str = "", **environment: str):
    package = {"headturn": "generator", "downstream-hpe": "downstream_hpe"}[program]
    code = (
        f"import sys\nfor name in {hidden.split()!r}:\n    sys.modules[name] = None\n"
        f"from {package}.cli import main\nmain()\n"
    )
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        env={**os.environ, "PYTHONPATH": str(ROOT), **environment},
        capture_output=True,
        stdin=subprocess.DEVNULL,
        timeout=120,
    )


def said(folder: Path, name: bytes, program: str, line: str, **environment: str) -> bytes:
    """What a command said of a folder of that name, or rather how it ended if that was no answer."""
    place = os.fsencode(folder) + b"/" + name
    words = [os.fsencode(word).replace(b"{}", place) for word in line.split()]
    done = run(program, *words, **environment)
    assert b"Traceback" not in done.stderr and b"PYTHONIOENCODING" not in done.stderr, done.stderr.decode(
        "latin-1"
    )
    assert done.returncode in (0, 1, 2, 3), done.stderr
    if done.returncode in (1, 2) and not line.startswith("verify"):
        assert done.stderr.splitlines()[-1].startswith(program.encode() + b": "), done.stderr
    return done.stdout + done.stderr


@pytest.mark.parametrize("environment", [ASCII, OLD_C], ids=["ascii", "old C"])
@pytest.mark.parametrize(
    ("program", "line"), [("headturn", "heads list {}/nowhere"), ("downstream-hpe", "predict {}/nowhere.png")]
)
def test_a_path_that_cannot_be_shown(tmp_path: Path, program: str, line: str, environment: dict) -> None:
    assert b"w\\" in said(tmp_path, "wörld".encode(), program, line, **environment)


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
        for line in lines:
            said(tmp_path, name, program, line, **environment)


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
