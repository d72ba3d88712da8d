# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of the first release, which digested all of them; later ones count where they are used."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from generator.plan.settings import ROWS, all_settings, plain

FIRST_SETTINGS = {
    "render": (
        *("resolution", "lens_mm", "distance_mm", "margin", "preset", "samples", "light_yaw_deg"),
        *("light_pitch_deg", "ambient", "background", "projection"),
    ),
    "landmarks": ("detector", "min_confidence"),
    "dataset": ("images", "image_format", "passes", "validation", "unit_size"),
}
"""Of the sections that do not choose rows."""


def common_values(configuration: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """What all parts of a dataset share: its configuration without what may grow: heads, poses, twins.

    A later setting that has its default is left out, so that parts which were built before it agree.
    """
    defaults = {known.name: plain(known.default) for known in all_settings()}
    of_rows = {known.name for known in all_settings() if known.info.grows}

    def counts(section: str, key: str, value: Any) -> bool:
        if f"{section}.{key}" in of_rows:
            return False
        if key in FIRST_SETTINGS.get(section, ()):
            return True
        return f"{section}.{key}" not in defaults or plain(value) != defaults[f"{section}.{key}"]

    return {
        section: {key: value for key, value in table.items() if counts(section, key, value)}
        if isinstance(table, Mapping)
        else table
        for section, table in configuration.items()
        if section not in ROWS
    }
