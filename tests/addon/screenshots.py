# SPDX-License-Identifier: GPL-3.0-or-later
"""`make screenshots`: the pictures of docs/blender.md, made anew. They are to be looked at; both themes stay
in .test-output/addon/screenshots, the dark one goes to docs/images."""

from __future__ import annotations

import shutil

import pytest
from real_blender import ROOT, RealBlender
from sitting import sit

pytestmark = pytest.mark.timeout(900)

NAMES = ("landmarks", "heads", "timeline", "looks", "build", "selected")


def test_screenshots(real_blender: RealBlender) -> None:
    out = sit(real_blender, "screenshots", HEADTURN_TEST_BLENDER=real_blender.executable)
    for name in NAMES:
        shutil.copyfile(out / f"dark_{name}.png", ROOT / "docs" / "images" / f"blender_{name}.png")
