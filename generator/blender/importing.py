# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's importers, which open any image that a file names, kept to one folder; and the way back out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
from bpy_extras import image_utils

from generator.errors import HeadError
from generator.heads.paths import find_below


def import_mesh(path: Path) -> None:
    """Read a file into the empty scene, in the pose it is stored in. ValueError: no importer for it."""
    match path.suffix.lower():
        case ".fbx":
            with _images_from(path.parent):
                bpy.ops.import_scene.fbx(filepath=str(path), use_anim=False)
        case ".glb":
            # Of generator.heads.gltf_draco: it names no other file.
            bpy.ops.import_scene.gltf(filepath=str(path))
        case suffix:
            raise ValueError(f"no importer for {suffix}")


def export_glb(path: Path) -> None:
    """Write the scene as it stands."""
    bpy.ops.export_scene.gltf(
        filepath=str(path),
        export_format="GLB",
        export_animations=False,
        export_rest_position_armature=False,
        export_all_influences=True,
        export_vertex_color="ACTIVE",
    )


@contextmanager
def _images_from(folder: Path) -> Iterator[None]:
    """A block in which importers load images from folder alone.

    For any other there is an empty one, which the file's own copy fills where it holds one:
    :mod:`generator.heads.fbx` has refused the file where it does not.
    """

    def load(name: str, dirname: str = "", **_: Any) -> Any:
        # The importer puts its folder before what is relative.
        inside = name.removeprefix(f"{folder}/").removeprefix(f"{folder}\\")
        try:
            return bpy.data.images.load(str(find_below(folder, inside, "texture").absolute()))
        except (HeadError, RuntimeError):
            image = bpy.data.images.new("missing", 1, 1)
            image.source = "FILE"  # what a file holds itself is only read as one; it has no path
            return image

    original, image_utils.load_image = image_utils.load_image, load
    try:
        yield
    finally:
        image_utils.load_image = original
