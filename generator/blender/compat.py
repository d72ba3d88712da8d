# SPDX-License-Identifier: GPL-3.0-or-later
"""Differences between the Blender versions we support, in one place."""

from __future__ import annotations

import ctypes
import re
from contextlib import suppress
from pathlib import Path

import bpy

OLDEST = (4, 2, 0)


def check_version() -> str:
    """The running Blender's version. RuntimeError if it is older than 4.2."""
    if bpy.app.version < OLDEST:
        raise RuntimeError(f"Blender {bpy.app.version_string} is too old: Headturn needs 4.2 or newer")
    return ".".join(map(str, bpy.app.version))


def write_exr_alone() -> None:
    """Have OpenEXR write with the thread that asks for it, where that is possible.

    Blender gives it a thread for every core there is, and it gives each row of an image to one of them: more
    work than to write it, on cores that are other workers'. Nothing in Blender's Python says otherwise, so
    the library is asked; one that is linked into the executable keeps its threads.
    """
    with suppress(OSError, AttributeError):
        mapped = Path("/proc/self/maps").read_text(encoding="utf-8")
        for library in set(re.findall(r"/.*/libOpenEXR[-.].*", mapped)):
            known = Path(library).read_bytes()
            for name in set(re.findall(rb"_ZN\d+Imf_\w+20setGlobalThreadCountEi", known)):
                ctypes.CDLL(library)[name.decode()](0)


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
