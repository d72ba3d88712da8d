# SPDX-License-Identifier: GPL-3.0-or-later
"""A script of steps, gone through in a Blender with a window. Its screenshots stay in .test-output/addon."""

from __future__ import annotations

import shutil
from pathlib import Path

from real_blender import ROOT, RealBlender

OUT = ROOT / ".test-output" / "addon"
SITTINGS = Path(__file__).with_name("sittings")


def sit(blender: RealBlender, name: str, **environment: str) -> Path:
    """Go through a sitting to its end; returns the folder with what it left."""
    out = OUT / name
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    script = str(SITTINGS / f"{name}.py")
    done = blender.run_with_window("--python", script, HEADTURN_TEST_OUT=str(out), **environment)
    said = done.stdout + done.stderr
    (out / "said.txt").write_text(said, encoding="utf-8")
    assert (out / "passed").exists(), said[-4000:]
    assert "Traceback" not in said, said[-4000:]
    return out
