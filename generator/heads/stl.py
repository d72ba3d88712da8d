# SPDX-License-Identifier: GPL-3.0-or-later
"""STL through trimesh: triangles alone, ASCII or binary."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from trimesh.exchange.stl import load_stl

from generator.errors import HeadError
from generator.heads.limits import MAX_TRIANGLES, check_count, read_mesh_bytes
from generator.heads.mesh import HeadMesh, Material
from generator.heads.obj import SKIN


def read_stl(path: Path) -> HeadMesh:
    """All solids of an STL, which has no colours.

    Raises
    ------
    HeadError: the file cannot be parsed.
    """
    try:
        data = load_stl(io.BytesIO(read_mesh_bytes(path)))
        # Of an ASCII file with several solids each is a geometry of its own.
        solids = list(data["geometry"].values()) if "geometry" in data else [data]
        corners = [np.asarray(s["vertices"], np.float64)[np.asarray(s["faces"])] for s in solids]
        points = np.concatenate(corners).reshape(-1, 3)
    except (HeadError, OSError):
        raise
    except Exception as error:  # trimesh raises whatever a malformed file makes it stumble over
        what = f"{type(error).__name__}: {error}"
        raise HeadError(f"not an STL file that can be read ({what}); export it again, binary") from error
    count = len(points) // 3
    check_count(count, MAX_TRIANGLES, "triangles")
    return HeadMesh(
        vertices=points,
        triangles=np.arange(3 * count, dtype=np.int32).reshape(-1, 3),
        uv=None,
        vertex_colors=None,
        material_index=np.zeros(count, dtype=np.int32),
        materials=(Material("skin", SKIN),),
        problems=("an STL has no colours; drawn as plain skin",),
    )
