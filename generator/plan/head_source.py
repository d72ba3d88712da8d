# SPDX-License-Identifier: GPL-3.0-or-later
"""What may stand for heads: a path, a maker's name, or NAME:ARGUMENT. stdlib only: Blender imports it too."""

from __future__ import annotations

from typing import Any

from generator import registries


def is_made(source: Any) -> bool:
    """Does a head source name a maker and no path?"""
    return isinstance(source, str) and source.partition(":")[0] in registries.HEAD_MAKERS


def split_path(value: str) -> tuple[str, str]:
    """What stands before the path in a setting of paths, and the path: ("", "scans"), ("ict:", "facekit").

    The path is "" where there is none: of makers that are told none, or something else.
    """
    name, colon, argument = value.partition(":")
    if name not in registries.HEAD_MAKERS:
        return "", value
    return (name + colon, argument) if name in registries.MAKERS_OF_FOLDERS else (value, "")
