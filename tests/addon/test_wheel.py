# SPDX-License-Identifier: GPL-3.0-or-later
"""The installed extension in the bpy wheel; `HEADTURN_BPY_PYTHON` names a Python with another bpy."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from placed_head import PlacedHead

from generator.heads.package import save_package


def test_the_extension_in_the_bpy_wheel(extension_zip: Path, placed_head: PlacedHead, tmp_path: Path) -> None:
    package = tmp_path / "head.npz"
    save_package(placed_head.mesh, package)
    (tmp_path / "profile").mkdir()
    script = Path(__file__).with_name("wheel_session.py")
    python = os.environ.get("HEADTURN_BPY_PYTHON", sys.executable)
    done = subprocess.run(
        [python, str(script), str(extension_zip), str(package)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "profile")},
    )
    assert "passed" in done.stdout and done.returncode == 0, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
