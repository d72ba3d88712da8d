# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel in a real window, with real clicks. Screenshots stay in .test-output/addon."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from real_blender import ROOT, RealBlender

from generator.dataset.proof.verify import verify_dataset
from generator.plan.config import load_config

OUT = ROOT / ".test-output" / "addon"


@pytest.mark.timeout(600)
def test_a_sitting(real_blender: RealBlender) -> None:
    """Load, turn, type, undo, scrub, preview, build, cancel, go wrong; see ui_session.py."""
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    script = Path(__file__).with_name("ui_session.py")
    done = real_blender.run_with_window("--python", str(script), HEADTURN_TEST_OUT=str(OUT))
    said = done.stdout + done.stderr
    assert (OUT / "passed").exists(), said[-4000:]
    assert "Traceback" not in said
    facts = json.loads((OUT / "facts.json").read_text(encoding="utf-8"))
    assert facts["rows"] == 6
    assert verify_dataset(OUT / "tiny").ok
    assert not (OUT / "long" / "manifest.json").exists()
    saved = load_config(OUT / "saved.toml", {})
    assert saved == load_config(OUT / "tiny" / "config.toml", {})
    assert saved.poses.yaw == [-20, 20, 20] and saved.render.resolution == 64
