# SPDX-License-Identifier: GPL-3.0-or-later
"""The files of a parametric head: OBJ, MTL and PNG, the same bytes for the same head."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from generator.heads.obj_write import topology_lines, write_obj
from generator.heads.parametric.curtain import curtain_topology
from generator.heads.parametric.eyes import eyeball_topology
from generator.heads.parametric.png import png_bytes
from generator.heads.parametric.template import PARTS, head_template

MATERIAL_FILE = "head.mtl"
_MATERIALS = """\
newmtl skin
Kd 1 1 1
map_Kd skin.png
newmtl eye
Kd 1 1 1
map_Kd eye.png
newmtl lash
Kd {:.4f} {:.4f} {:.4f}
"""
_NAMES = ("skin", "eye", "lash", "hair")
_HAIR_MATERIAL = """\
newmtl hair
Kd 1 1 1
map_Kd hair.png
"""


def write_mesh(path: Path, vertices: np.ndarray, long_hair: bool) -> None:
    """Write vertices [N, 3] in mm with their triangles as OBJ (micrometres kept)."""
    write_obj(path, MATERIAL_FILE, vertices, _topology(long_hair))


def write_materials(folder: Path, lash_color: np.ndarray, long_hair: bool) -> None:
    """Write head.mtl: skin.png, eye.png, a plain colour for the lashes, hair.png for long hair."""
    text = _MATERIALS.format(*lash_color) + (_HAIR_MATERIAL if long_hair else "")
    (folder / MATERIAL_FILE).write_text(text, encoding="ascii", newline="\n")


def write_texture(path: Path, pixels: np.ndarray) -> None:
    """Write uint8 [H, W, 3] as PNG without any metadata."""
    path.write_bytes(png_bytes(pixels))


def head_triangles(long_hair: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles int [T, 3], texture corners int [T, 3] and material names [T] of a head."""
    template = head_template()
    lash = template.part == PARTS.index("lashes")
    count, count_uv = len(template.canonical), len(template.uv)
    triangles, corners = [template.triangles], [template.triangle_uv]
    names = [np.where(lash, "lash", "skin")]
    eye, eye_uv = eyeball_topology()
    for _ in ("left", "right"):
        triangles.append(eye + count)
        corners.append(eye + count_uv)
        names.append(np.full(len(eye), "eye"))
        count += len(eye_uv)
    if long_hair:
        sheet, _ = curtain_topology()
        triangles.append(sheet + count)
        corners.append(sheet + count_uv + len(eye_uv))
        names.append(np.full(len(sheet), "hair"))
    return np.concatenate(triangles), np.concatenate(corners), np.concatenate(names)


@lru_cache(maxsize=2)
def _topology(long_hair: bool) -> bytes:
    """The part of the OBJ that all heads share."""
    triangles, corners, names = head_triangles(long_hair)
    uv = [head_template().uv, eyeball_topology()[1]] + ([curtain_topology()[1]] if long_hair else [])
    groups = ((name, triangles[names == name], corners[names == name]) for name in _NAMES)
    return topology_lines(np.concatenate(uv), groups)
