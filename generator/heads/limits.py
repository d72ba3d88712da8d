# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a head's files may hold. stdlib only: the render worker reads it, too.

Far above any head that was scanned, sculpted or made, and low enough that a file of a few kilobytes
takes neither minutes nor the machine's memory.
"""

from __future__ import annotations

from pathlib import Path

from generator.errors import HeadError
from generator.reading import check_regular, read_limited

MAX_MESH_BYTES = 1 << 30
MAX_GEOMETRY_BYTES = 1 << 29
"""Of what a mesh file unpacks to."""

MAX_VERTICES = MAX_TRIANGLES = 1 << 22
"""Of a scene that says how often each of its meshes is drawn."""

MAX_MOVES = 1 << 28
"""Vertices times the morph targets and joints that move each."""

MAX_MATERIALS = 1000
MAX_NODES = 10_000
MAX_DEPTH = 256
MAX_EXPRESSIONS = 10_000
"""Of a subject."""

MAX_TEXTURE_PIXELS = 1 << 26
"""8192 x 8192."""

MAX_PIXELS = 1 << 29
"""Of all textures of a head."""


def check_mesh_file(path: Path) -> None:
    """HeadError: too large; OSError: no regular file, or not there."""
    try:
        check_regular(path, MAX_MESH_BYTES)
    except ValueError as error:
        raise HeadError(f"{path.name} {error}; make it smaller") from error


def read_mesh_bytes(path: Path, limit: int = MAX_MESH_BYTES) -> bytes:
    """A file of a head. Raises HeadError: too large; OSError: no regular file, or it cannot be read."""
    try:
        return read_limited(path, limit)
    except ValueError as error:
        raise HeadError(f"{path.name} {error}; make it smaller") from error


def check_count(count: int, limit: int, what: str) -> None:
    """HeadError: more of something than a head may have."""
    if count > limit:
        raise HeadError(f"more than {limit:,} {what}; reduce the mesh")
