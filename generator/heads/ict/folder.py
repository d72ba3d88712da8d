# SPDX-License-Identifier: GPL-3.0-or-later
"""The MTL of a head of ICT-FaceKit, and the part of its OBJ that all share."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

import numpy as np

from generator.heads.ict.atlas import IN_ATLAS, Surface
from generator.heads.obj_write import Group, topology_lines
from generator.heads.parametric.curtain import curtain_topology

MATERIAL_FILE = "head.mtl"
_MATERIALS = ("skin", "eye", "lash", "hair")


def write_materials(folder: Path, long_hair: bool) -> None:
    """Write head.mtl: a texture a material."""
    names = _MATERIALS if long_hair else _MATERIALS[:-1]
    text = "".join(f"newmtl {name}\nKd 1 1 1\nmap_Kd {name}.png\n" for name in names)
    (folder / MATERIAL_FILE).write_text(text, encoding="ascii", newline="\n")


@lru_cache(maxsize=2)
def topology(surface: Surface, long_hair: bool) -> bytes:
    """The lines of the OBJ that all heads share; long hair comes last."""
    mesh, sheet, uv = surface.mesh, *curtain_topology()
    groups: list[Group] = []
    for name, parts in (("skin", IN_ATLAS), ("eye", ("eye_left", "eye_right")), ("lash", ("lashes",))):
        chosen = mesh.of_part(*parts)
        groups.append((name, mesh.triangles[chosen], mesh.corners[chosen]))
    if long_hair:
        groups.append(("hair", sheet + len(mesh.neutral), sheet + len(mesh.uv)))
    return topology_lines(np.concatenate([mesh.uv, uv] if long_hair else [mesh.uv]), groups)
