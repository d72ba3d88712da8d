# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's importers, which open any image that a file names, kept to one folder; and the way back out."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import bpy
from bpy_extras import image_utils

from generator.blender.usd_layers import plain_layer
from generator.errors import HeadError
from generator.heads.paths import find_below

_USD = {
    **dict.fromkeys(("import_cameras", "import_curves", "import_lights", "import_volumes"), False),
    **dict.fromkeys(("import_points", "import_shapes", "import_blendshapes", "import_subdiv"), False),
    **dict.fromkeys(("import_guide", "import_proxy", "support_scene_instancing"), False),
    **dict.fromkeys(("create_world_material", "set_frame_range", "set_material_blend"), False),
    **dict.fromkeys(("import_materials", "import_meshes", "import_skeletons", "validate_meshes"), True),
    **dict.fromkeys(("import_render", "import_visible_only", "import_usd_preview"), True),
    "apply_unit_conversion_scale": True,
    "import_textures_mode": "IMPORT_NONE",
    "scale": 1.0,
}
"""What a head is of a USD stage; a Blender knows only some of them."""


def import_mesh(path: Path) -> dict[str, str]:
    """Read a file into the empty scene, in the pose it is stored in. ValueError: no importer for it.

    Returns
    -------
    By the names of images that stand for others, what the file says; of most formats nothing.
    """
    match path.suffix.lower():
        case ".fbx":
            with _images_from(path.parent):
                bpy.ops.import_scene.fbx(filepath=str(path), use_anim=False)
        case ".glb":
            # Of generator.heads.gltf_draco: it names no other file.
            bpy.ops.import_scene.gltf(filepath=str(path))
        case ".usda" | ".usdc":
            plain, names = plain_layer(path, path.parent)
            known = set(bpy.ops.wm.usd_import.get_rna_type().properties.keys())
            options = {key: value for key, value in _USD.items() if key in known}
            bpy.ops.wm.usd_import(filepath=str(plain), **options)
            return names
        case suffix:
            raise ValueError(f"no importer for {suffix}")
    return {}


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
