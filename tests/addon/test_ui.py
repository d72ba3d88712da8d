# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel in a real window, with real clicks: five sittings, each in a Blender of its own."""

from __future__ import annotations

import json

import pytest
from real_blender import RealBlender
from sitting import sit

from generator.dataset.format.heads_table import read_heads
from generator.dataset.proof.verify import verify_dataset
from generator.picture.settled import settled
from generator.plan.config import load_config
from generator.plan.view_plan import drawn_values

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


def test_an_environment_is_named_and_what_is_missing_is_said(real_blender: RealBlender) -> None:
    sit(real_blender, "host")


def test_heads_are_loaded_and_turned(real_blender: RealBlender) -> None:
    out = sit(real_blender, "heads", HEADTURN_TEST_BLENDER=real_blender.executable)
    assert json.loads((out / "facts.json").read_text(encoding="utf-8"))["changed"] > 0.05
    # And the head of a user's own scene, whose texture lies elsewhere.
    assert json.loads((out / "mine.json").read_text(encoding="utf-8"))["rows"] == 3
    report = verify_dataset(out / "ada")
    assert report.ok, report.text()
    [head] = read_heads(out / "ada")
    assert [name for name, _ in head.file_sha256] == ["mine.blend", "../mine/eye.png", "../mine/skin.png"]


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
