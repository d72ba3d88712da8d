# SPDX-License-Identifier: GPL-3.0-or-later
"""What may be asked of heads in Blender scenes, which are rendered as they stand."""

from __future__ import annotations

from dataclasses import fields, replace
from typing import Any

from generator.errors import UsageError
from generator.plan.config import BuildConfig
from generator.plan.factors import FACTORS
from generator.plan.passes import SEGMENTATION
from generator.plan.render_settings import Lens, Look, Render, Sensor
from generator.plan.settings import section_settings

_LENS = {one.name for one in fields(Lens)} - {"resolution", "scene_camera", "variety"}
_LIGHT = {one.name for one in fields(Look)} - {one.name for one in fields(Sensor)} - {"preset", "samples"}
"""What a scene's own light, world and materials decide. The preset is no matter: the engine is theirs."""


def check_of_scenes(config: BuildConfig, scenes: bool) -> None:
    """UsageError: a setting is given that heads of a scene, or others, cannot have. scenes: are there any?"""
    render = config.render
    if not scenes:
        if render.scene_camera:
            raise UsageError("--scene-camera: the heads are in no Blender scene; remove it")
        return
    overruled = _LIGHT | _LENS if render.scene_camera else _LIGHT
    for known in section_settings("render", Render):
        drawn = any(name.split(".")[:2] == ["render", known.key] for name in config.drawn)
        if known.key in overruled and (drawn or getattr(render, known.key) != known.default):
            whose = "its own camera" if known.key in _LENS else "its own light, world and materials"
            raise UsageError(f"{known.flag}: a scene is rendered with {whose}; remove it")
    for factor in config.dataset.twins:
        if set(FACTORS[factor].settings) & overruled:
            raise UsageError(f"--twins {factor}: a scene is rendered as it stands; leave {factor} out")
    for name in config.dataset.passes:
        if name == SEGMENTATION.name:
            raise UsageError(f"--passes {name}: the materials of a scene do not tell it; leave {name} out")


def seen_look(look: Look) -> Look:
    """The look of an image of a scene, for its row: what the scene decided is not said."""
    unsaid: dict[str, Any] = {}
    for known in section_settings("look", Look):
        if known.key in _LIGHT and known.info.varies:
            several = isinstance(known.default, tuple)
            nothing = "" if known.kind is str else float("nan")
            unsaid[known.key] = (nothing,) * len(known.default) if several else nothing
    return replace(look, **unsaid)
