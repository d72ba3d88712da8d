# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel in a real window, with real clicks: five sittings, each in a Blender of its own.

Screenshots stay in .test-output/addon.
"""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from real_blender import ROOT, RealBlender

from generator.dataset.proof.verify import verify_dataset
from generator.picture.settled import settled
from generator.plan.config import load_config
from generator.plan.view_plan import drawn_values

OUT = ROOT / ".test-output" / "addon"
SITTINGS = Path(__file__).with_name("sittings")

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


def sit(blender: RealBlender, name: str) -> Path:
    """Go through a sitting to its end; returns the folder with what it left."""
    out = OUT / name
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    script = str(SITTINGS / f"{name}.py")
    done = blender.run_with_window("--python", script, HEADTURN_TEST_OUT=str(out))
    said = done.stdout + done.stderr
    (out / "said.txt").write_text(said, encoding="utf-8")
    assert (out / "passed").exists(), said[-4000:]
    assert "Traceback" not in said, said[-4000:]
    return out


def test_an_environment_is_named_and_what_is_missing_is_said(real_blender: RealBlender) -> None:
    sit(real_blender, "host")


def test_heads_are_loaded_and_turned(real_blender: RealBlender) -> None:
    out = sit(real_blender, "heads")
    assert json.loads((out / "facts.json").read_text(encoding="utf-8"))["changed"] > 0.05


def test_pictures_are_what_the_build_would_make(real_blender: RealBlender) -> None:
    sit(real_blender, "pictures")


def test_the_dice_show_the_looks_of_a_build(real_blender: RealBlender) -> None:
    out = sit(real_blender, "looks")
    facts = json.loads((out / "facts.json").read_text(encoding="utf-8"))
    config = settled(load_config(None, {"render": {"variety": "photo"}, "poses": {"seed": facts["seed"]}}))
    yaw, pitch, roll = facts["pose"]
    assert facts["drawn"] == drawn_values(config, facts["head"], (yaw, pitch, roll))
    assert len(facts["drawn"]) > 15


def test_datasets_are_built_continued_and_refused(real_blender: RealBlender) -> None:
    out = sit(real_blender, "build")
    assert json.loads((out / "facts.json").read_text(encoding="utf-8"))["rows"] == 6
    assert verify_dataset(out / "tiny").ok
    assert not (out / "long" / "manifest.json").exists()
    saved = load_config(out / "saved.toml", {})
    assert saved == load_config(out / "tiny" / "config.toml", {})
    assert saved.poses.yaw == (-20, 20, 20) and saved.render.resolution == 64
