# SPDX-License-Identifier: GPL-3.0-or-later
"""How the first release named units, so that its datasets can grow.

It hashed every setting and the release itself. Its content is that of content version 1.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from generator.content import CONTENT, RELEASE
from generator.plan.config import BuildConfig
from generator.plan.first_settings import FIRST_SETTINGS, later_settings
from generator.plan.settings import plain

if TYPE_CHECKING:
    from generator.execution.build.units import PlannedHead

_SCHEMA = "1.1.0"
_CONTENT_VERSION = "1"

Namer = Callable[[Any, Any], str]
"""The name of a unit from its poses and their indices."""


def names(
    planned: PlannedHead, config: BuildConfig, recorded: Mapping[str, str] | None, versions: Mapping[str, str]
) -> Namer | None:
    """What names the units of a head as the first release did; None where it cannot have built them.

    recorded: versions of the parts that are there. versions: those of today.
    """
    if recorded is None or CONTENT in recorded or versions.get(CONTENT) != _CONTENT_VERSION:
        return None
    if any(versions.get(name) != value for name, value in recorded.items() if name != RELEASE):
        return None
    if later_settings(config.as_dict()) or planned.head.without or any(planned.placement.turned_deg):
        return None
    settings = {key: plain(getattr(config.render, key)) for key in FIRST_SETTINGS["render"]}
    settings["samples"] = config.render.cycles_samples
    head, placement = planned.head, planned.placement
    look = _digest(
        {
            "settings": settings,
            "prepared": {key: plain(value) for key, value in vars(placement).items() if key != "turned_deg"},
            "anchors": base64.b64encode(np.ascontiguousarray(planned.points, "<f8").tobytes()).decode(
                "ascii"
            ),
            "distance_mm": planned.camera.distance_mm,
            "split": planned.split,
            "images": config.dataset.images,
            "image_format": config.dataset.image_format,
            "passes": plain(config.dataset.passes),
            "subject": head.subject,
            "expression": head.expression,
            "license": [head.license, head.redistributable],
            "files": planned.file_sha256,
            "landmarks": {key: getattr(config.landmarks, key) for key in FIRST_SETTINGS["landmarks"]},
            "versions": dict(recorded),
            "schema": _SCHEMA,
        }
    )
    return lambda poses, indices: _digest([look, _digest([poses, indices])])[:16]


def _digest(values: Any) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
