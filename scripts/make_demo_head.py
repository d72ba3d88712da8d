# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the head that turns along on the page of ``downstream-hpe demo``.

    python scripts/make_demo_head.py

Writes ``downstream_hpe/demo/page/head.bin``: the mean of parametric heads, which are CC0, without lashes and
long hair. Little-endian: uint32 V, uint32 T; int16 [V, 3], vertices in hundredths of a mm, frame C, the pivot
of the tables at the origin; uint8 [V, 4], their colours, RGBA; uint16 [T, 3], triangles.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from downstream_hpe.demo.folder import SOURCE
from downstream_hpe.geometry.face_mesh import NOSE_TIP
from downstream_hpe.geometry.mean_head import mean_head
from generator.heads.mesh import HeadMesh
from generator.heads.parametric.make import make_heads
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

HEADS, SEED = 24, 2024
CLAY = (206, 186, 172, 255)
NECK_MM = 118.0
"""So far below the pivot the neck ends, level."""


def of_material(mesh: HeadMesh, name: str) -> np.ndarray:
    """Which triangles have it, bool [T]."""
    return mesh.material_index == [material.name for material in mesh.materials].index(name)


def colours(mesh: HeadMesh) -> np.ndarray:
    """uint8 [V, 4]: the eyes as they are painted, the rest one colour."""
    found = np.tile(np.array(CLAY, dtype=np.uint8), (len(mesh.vertices), 1))
    eyes = of_material(mesh, "eye")
    [painted] = [material.texture for material in mesh.materials if material.name == "eye"]
    texture = np.asarray(Image.open(painted).convert("RGB"))
    u, v = np.moveaxis(mesh.uv[eyes], -1, 0)
    rows, columns = ((1 - v) * (len(texture) - 1)).astype(int), (u * (texture.shape[1] - 1)).astype(int)
    found[mesh.triangles[eyes], :3] = texture[rows, columns]
    return found


def main() -> None:
    """Make heads, average, write."""
    with tempfile.TemporaryDirectory() as scratch:
        make_heads(Path(scratch), count=HEADS, seed=SEED)
        meshes = [read_mesh(head, Path(scratch)) for head in find_heads(Path(scratch)).heads]
        # Long hair is a material of its own.
        alike = [mesh for mesh in meshes if len(mesh.materials) == 3]
        mean = np.mean([mesh.vertices for mesh in alike], axis=0)
        colour = colours(alike[0])
    triangles = alike[0].triangles[of_material(alike[0], "skin") | of_material(alike[0], "eye")]
    # y up and z to the viewer, as meshes have it; frame C has y down and z into the scene.
    points = mean * [1.0, -1.0, -1.0]
    middle = np.flatnonzero(np.abs(points[:, 0]) < 2)
    points += mean_head()[NOSE_TIP] - points[middle[np.argmin(points[middle, 2])]]
    triangles = triangles[(points[triangles, 1] < NECK_MM).any(axis=1)]
    points[:, 1] = np.minimum(points[:, 1], NECK_MM)
    used, triangles = np.unique(triangles, return_inverse=True)
    parts = [
        np.array([len(used), triangles.size // 3], dtype="<u4"),
        np.rint(100 * points[used]).astype("<i2"),
        colour[used],
        triangles.astype("<u2"),
    ]
    (SOURCE / "head.bin").write_bytes(b"".join(part.tobytes() for part in parts))
    size = (SOURCE / "head.bin").stat().st_size
    print(f"{len(alike)} heads: {len(used)} vertices, {triangles.size // 3} triangles, {size:,} bytes")


if __name__ == "__main__":
    main()
