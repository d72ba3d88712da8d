# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes of a few triangles, written in every way a head may come."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

TETRAHEDRON = "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\n"
FACES = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
UV = "vt 0.1 0.1\nvt 0.4 0.1\nvt 0.1 0.4\n"
TEXTURED_FACES = "f 1/1 3/2 2/3\nf 1/1 2/2 4/3\nf 1/1 4/2 3/3\nf 2/1 3/2 4/3\n"


def plain_obj(path: Path) -> Path:
    """No material at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(TETRAHEDRON + FACES)
    return path


def textured_obj(
    folder: Path, map_kd: str = "skin.png", *, mtl: str = "head.mtl", image: bool = True
) -> Path:
    """head.obj, its MTL and a small PNG."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "head.obj").write_text(f"mtllib head.mtl\n{TETRAHEDRON}{UV}usemtl skin\n{TEXTURED_FACES}")
    (folder / mtl).write_text(f"newmtl skin\nKd 0 0 0\nmap_Kd {map_kd}\n")
    if image:
        Image.new("RGB", (8, 8), (200, 150, 130)).save(folder / "skin.png")
    return folder / "head.obj"
