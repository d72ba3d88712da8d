# SPDX-License-Identifier: GPL-3.0-or-later
"""A parametric head on disk: OBJ, MTL, PNG and head.json, the same bytes for the same head."""

from __future__ import annotations

import json
from functools import lru_cache
from pathlib import Path

import numpy as np

from generator.heads.parametric.curtain import curtain_topology
from generator.heads.parametric.eyes import eyeball_topology
from generator.heads.parametric.png import png_bytes
from generator.heads.parametric.template import PARTS, head_template
from generator.sealed import sealed

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
_HAIR_MATERIAL = """\
newmtl hair
Kd 1 1 1
map_Kd hair.png
"""


def write_mesh(path: Path, vertices: np.ndarray, long_hair: bool) -> None:
    """Write vertices [N, 3] in mm with their triangles as OBJ (micrometres kept)."""
    lines = b"v %.3f %.3f %.3f\n" * len(vertices) % tuple(vertices.ravel().tolist())
    path.write_bytes(b"mtllib %s\n" % MATERIAL_FILE.encode() + lines + _topology(long_hair))


def write_materials(folder: Path, lash_color: np.ndarray, long_hair: bool) -> None:
    """Write head.mtl: skin.png, eye.png, a plain colour for the lashes, hair.png for long hair."""
    text = _MATERIALS.format(*lash_color) + (_HAIR_MATERIAL if long_hair else "")
    (folder / MATERIAL_FILE).write_text(text, encoding="ascii", newline="\n")


def write_texture(path: Path, pixels: np.ndarray) -> None:
    """Write uint8 [H, W, 3] as PNG without any metadata."""
    path.write_bytes(png_bytes(pixels))


def write_description(path: Path, description: dict) -> None:
    """Write head.json, with a checksum of itself."""
    path.write_text(json.dumps(sealed(description), indent=1) + "\n", encoding="utf-8", newline="\n")


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
    text = [f"vt {u:.6f} {v:.6f}\n" for u, v in np.concatenate(uv).tolist()]
    both = np.stack([triangles, corners], axis=-1).reshape(-1, 6) + 1
    for name in ("skin", "eye", "lash", "hair"):
        rows = both[names == name].tolist()
        if rows:
            text.append(f"usemtl {name}\n")
            text += [f"f {a}/{au} {b}/{bu} {c}/{cu}\n" for a, au, b, bu, c, cu in rows]
    return "".join(text).encode("ascii")
