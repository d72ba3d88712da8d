# SPDX-License-Identifier: GPL-3.0-or-later
"""Differences between the Blender versions we support, in one place."""

from __future__ import annotations

import bpy

OLDEST = (4, 2, 0)


def check_version() -> str:
    """The running Blender's version. RuntimeError if it is older than 4.2."""
    if bpy.app.version < OLDEST:
        raise RuntimeError(f"Blender {bpy.app.version_string} is too old: Headturn needs 4.2 or newer")
    return ".".join(map(str, bpy.app.version))


def use_still_images(settings: bpy.types.ImageFormatSettings) -> None:
    """5.x asks for the medium before the file format."""
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"


def use_multilayer(settings: bpy.types.ImageFormatSettings) -> None:
    """OpenEXR with every pass, float32."""
    if hasattr(settings, "media_type"):
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    settings.color_depth, settings.exr_codec = "32", "NONE"
