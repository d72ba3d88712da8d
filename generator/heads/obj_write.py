# SPDX-License-Identifier: GPL-3.0-or-later
"""OBJ files of heads that share everything but where their vertices are."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

Group = tuple[str, np.ndarray, np.ndarray]
"""A material's name, its triangles int [T, 3] and their texture corners int [T, 3], both from 0 on."""


def topology_lines(uv: np.ndarray, groups: Iterable[Group]) -> bytes:
    """What heads share: texture vertices [U, 2], and the faces of materials that have some."""
    text = [f"vt {u:.6f} {v:.6f}\n" for u, v in uv.tolist()]
    for name, triangles, corners in groups:
        rows = (np.stack([triangles, corners], axis=-1).reshape(-1, 6) + 1).tolist()
        if rows:
            text.append(f"usemtl {name}\n")
            text += [f"f {a}/{au} {b}/{bu} {c}/{cu}\n" for a, au, b, bu, c, cu in rows]
    return "".join(text).encode("ascii")


def write_obj(path: Path, materials: str, vertices: np.ndarray, topology: bytes) -> None:
    """Write vertices [N, 3] in mm (micrometres kept) with the lines that heads share.

    materials: the MTL file beside it.
    """
    lines = b"v %.3f %.3f %.3f\n" * len(vertices) % tuple(vertices.ravel().tolist())
    path.write_bytes(b"mtllib %s\n" % materials.encode() + lines + topology)
