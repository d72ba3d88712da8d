# SPDX-License-Identifier: GPL-3.0-or-later
"""A real Blender: the extension is valid, installs, and builds the same bytes as the command line."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from real_blender import ROOT, RealBlender

from generator.dataset.format.manifest import read_manifest

MODULE = "bl_ext.user_default.headturn"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="session")
def small_build(parametric_heads: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A configuration of three poses and the dataset that `headturn build` makes of it."""
    folder = tmp_path_factory.mktemp("small")
    (folder / "small.toml").write_text(
        f'[heads]\nsource = "{parametric_heads}"\nsubjects = ["s1p0000"]\n'
        "[poses]\nyaw = [-30, 30, 30]\npitch = [0, 0, 10]\nroll = [0, 0, 10]\n[render]\nresolution = 96\n",
        encoding="utf-8",
    )
    command = [
        sys.executable,
        "-m",
        "generator.cli",
        "build",
        "small.toml",
        "--out",
        "host",
        "--workers",
        "1",
    ]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder


def same_content(a: Path, b: Path) -> bool:
    one, other = read_manifest(a), read_manifest(b)
    parts = [[(part.path, part.sha256) for part in manifest.parts] for manifest in (one, other)]
    return one.digest == other.digest and parts[0] == parts[1]


def test_the_extension_is_valid_and_enabled(real_blender: RealBlender, extension_zip: Path) -> None:
    said = real_blender.run("--command", "extension", "validate", str(extension_zip))
    assert "Success" in said.stdout + said.stderr
    code = (
        "import bpy, sys, addon_utils\n"
        f"name = '{MODULE}'\n"
        "assert name in bpy.context.preferences.addons\n"
        "assert not any('numpy' in m for m in sys.modules if m.startswith(name))\n"
        f"assert '{MODULE}.studio' not in sys.modules, 'start-up must stay light'\n"
        "for _ in range(2):\n"
        "    addon_utils.disable(name)\n"
        "    assert not hasattr(bpy.types.Scene, 'headturn')\n"
        "    addon_utils.enable(name)\n"
        "assert bpy.context.scene.headturn.yaw == 0\n"
    )
    said = real_blender.run("--background", "--python-exit-code", "4", "--python-expr", code)
    assert "Error" not in said.stdout + said.stderr and "Traceback" not in said.stdout + said.stderr


def test_the_command_builds_what_the_host_builds(real_blender: RealBlender, small_build: Path) -> None:
    """Under a colour management that does not exist, see host_python.sh: it may change no pixel."""
    config, out = str(small_build / "small.toml"), str(small_build / "command")
    arguments = ("--background", "--command", "headturn")
    said = real_blender.run(*arguments, "build", config, "--out", out, "--workers", "1")
    assert "rendering 0 of 3" in said.stdout and "3 images" in said.stdout
    assert same_content(Path(out), small_build / "host")
    (small_build / "temporary").mkdir()
    real_blender.run(*arguments, "verify", out, TMPDIR=str(small_build / "temporary"))
    assert not [*(small_build / "temporary").iterdir()]
    assert real_blender.run(*arguments, "verify", str(small_build), check=False).returncode == 1
    wrong = real_blender.run(*arguments, "build", "nowhere.toml", check=False)
    assert wrong.returncode == 2 and "nowhere.toml" in wrong.stderr
    lost = real_blender.run(*arguments, "build", config, check=False, HEADTURN_PYTHON="/nowhere")
    assert lost.returncode == 2 and "HEADTURN_PYTHON" in lost.stderr


def test_without_the_extension_a_script_does_the_same(
    real_blender: RealBlender, small_build: Path, tmp_path: Path
) -> None:
    """It goes on with the host's dataset, whose units have the same names."""
    shutil.copytree(small_build / "host", small_build / "script")
    (small_build / "script" / "manifest.json").unlink()
    script, out = str(ROOT / "blender_addon" / "headless.py"), str(small_build / "script")
    flags = ("--background", "--factory-startup", "--python-exit-code", "1", "--python", script, "--")
    config = str(small_build / "small.toml")
    said = real_blender.run(*flags, "build", config, "--out", out, "--workers", "1", TMPDIR=str(tmp_path))
    assert not [*tmp_path.iterdir()], "nothing is left, nor is it by the command"
    assert "continuing: 1 of 1 units are already there" in said.stdout, said.stdout
    assert same_content(Path(out), small_build / "host")
    assert real_blender.run(*flags, "verify", "/nowhere", check=False).returncode == 1


def test_python_builds_to_the_end_or_says_why_not(real_blender: RealBlender, tmp_path: Path) -> None:
    script = str(Path(__file__).with_name("build_from_python.py"))
    flags = ("--background", "--python-exit-code", "4", "--python", script, "--", str(tmp_path))
    said = real_blender.run(*flags)
    assert "passed" in said.stdout and "rendering 0 of 3" in said.stdout, said.stdout + said.stderr


def test_modules_beside_the_data_are_not_imported(
    real_blender: RealBlender, small_build: Path, tmp_path: Path
) -> None:
    """Not by Blender, not by the host, not by a render worker in that Blender."""
    names = {*sys.stdlib_module_names, "bpy", "mathutils", "numpy", "cv2", "pyarrow", "mediapipe"}
    code = f"open({str(tmp_path / 'mark')!r}, 'a').write(__name__)\n1 / 0\n"
    for name in names:
        (tmp_path / f"{name}.py").write_text(code)
    command = [sys.executable, "-m", "generator.cli", "build", str(small_build / "small.toml"), "--out", "d"]
    command += ["--workers", "1", "--blender", real_blender.executable]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    real_blender.run("--background", "--command", "headturn", "verify", "d", cwd=tmp_path)
    script = str(ROOT / "blender_addon" / "headless.py")
    flags = ("--background", "--factory-startup", "--python-exit-code", "1", "--python", script, "--")
    real_blender.run(*flags, "verify", "d", cwd=tmp_path)
    assert not (tmp_path / "mark").exists(), (tmp_path / "mark").read_text()


def test_another_blender_renders_and_the_labels_stay(blender_command: Path, small_build: Path) -> None:
    out = small_build / "other"
    command = [sys.executable, "-m", "generator.cli", "build", "small.toml", "--out", str(out)]
    command += ["--workers", "1", "--blender", str(blender_command)]
    subprocess.run(command, cwd=small_build, check=True, capture_output=True)
    ours, theirs = (pq.read_table(folder / "data").to_pylist() for folder in (small_build / "host", out))
    rendered = {"landmarks", "detected", "image_sha256"}
    for a, b in zip(ours, theirs, strict=True):
        assert {name for name in a if a[name] != b[name]} <= rendered
    assert read_manifest(out).versions["blender"] != read_manifest(small_build / "host").versions["blender"]


@pytest.mark.parametrize(
    ("answer", "expected"), [("Blender 4.1.1", "too old"), ("gimp 2.10", "does not answer --version")]
)
def test_what_cannot_render_is_refused(tmp_path: Path, answer: str, expected: str) -> None:
    fake = tmp_path / "blender"
    fake.write_text(f"#!/bin/sh\necho '{answer}'\n")
    fake.chmod(0o755)
    command = [sys.executable, "-m", "generator.cli", "build", "--out", str(tmp_path / "d")]
    done = subprocess.run([*command, "--blender", str(fake)], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and expected in done.stderr
