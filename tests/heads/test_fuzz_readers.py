# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever bytes a stranger's head file holds: a mesh comes out that is sound, or a HeadError."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from generator.errors import HeadError
from generator.heads.mesh import HeadMesh
from generator.heads.mtl import read_mtl
from generator.heads.obj import read_obj
from generator.heads.ply import read_ply

pytestmark = pytest.mark.slow

EXAMPLES = int(os.environ.get("HEADTURN_FUZZ", "300"))
"""A reader each; set HEADTURN_FUZZ to look longer."""

fuzz = settings(
    max_examples=EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.too_slow], derandomize=True
)

NUMBERS = st.one_of(
    st.sampled_from(["0", "1", "-1", "1e309", "nan", "inf", "1e-320", "0x10", "1_0", "1,5", "", "9" * 400]),
    st.floats(-10, 10).map(str),
    st.integers(-(2**65), 2**65).map(str),
)
INDICES = st.one_of(
    st.integers(-6, 6).map(str),
    st.sampled_from(["0", "999999999", "1//1", "1/1/1", "1/", "/1", "-1/-1/-1", "1/1/1/1", "2.5", "x"]),
)


def line(key: str, words: st.SearchStrategy[str], most: int = 6) -> st.SearchStrategy[str]:
    return st.lists(words, max_size=most).map(lambda chosen: " ".join([key, *chosen]))


VERTEX = st.tuples(*[st.floats(-9, 9).map(str)] * 3).map(lambda words: "v " + " ".join(words))
OBJ_LINES = st.one_of(
    VERTEX,
    VERTEX,
    line("f", st.integers(1, 4).map(str), 5),
    line("v", NUMBERS),
    line("vt", NUMBERS),
    line("vn", NUMBERS),
    line("f", INDICES),
    st.sampled_from(
        ["usemtl a", "usemtl", "mtllib a.mtl", "mtllib ../a.mtl", "g x", "o \\", "\\", "#", "s off"]
    ),
    st.text(max_size=20),
)
MTL_LINES = st.one_of(
    line("newmtl", st.text(max_size=8), 2),
    line("Kd", NUMBERS, 4),
    line("map_Kd", st.one_of(st.text(max_size=12), st.sampled_from(["-s", "-o", "-bm", "1", "../a.png"])), 8),
    line("d", NUMBERS, 2),
    st.text(max_size=20),
)
PLY_HEADERS = st.lists(
    st.one_of(
        st.sampled_from(
            [
                "format ascii 1.0", "format binary_little_endian 1.0", "format binary_big_endian 1.0",
                "property float x", "property float y", "property float z", "property double x",
                "property uchar red", "property list uchar int vertex_indices",
                "property list int int vertex_index", "property list char uchar vertex_indices",
                "comment TextureFile a.png", "property", "element", "obj_info",
            ]
        ),
        st.integers(-1, 5).map(lambda n: f"element vertex {n}"),
        st.integers(-1, 3).map(lambda n: f"element face {n}"),
        st.sampled_from([f"element vertex {10**12}", f"element face {2**63}", "element vertex x"]),
    ),
    max_size=12,
)  # fmt: skip


def sound(mesh: HeadMesh) -> None:
    """What every reader promises of what it returns."""
    assert mesh.vertices.ndim == 2 and mesh.vertices.shape[1] == 3
    assert np.isfinite(mesh.vertices).all()
    assert len(mesh.triangles)
    assert mesh.triangles.min() >= 0 and mesh.triangles.max() < len(mesh.vertices)
    assert mesh.uv is None or np.isfinite(mesh.uv).all()


def read(reader: object, name: str, content: bytes) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / name
        path.write_bytes(content)
        try:
            read = reader(path, path.parent) if reader is read_obj else reader(path)  # type: ignore[operator]
        except HeadError as error:
            assert "\n" not in str(error)
            return
    if isinstance(read, HeadMesh):
        sound(read)


@fuzz
@given(st.lists(OBJ_LINES, max_size=30).map("\n".join).map(lambda text: text.encode(errors="surrogatepass")))
@example(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
@example(b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 1000000000\n")
def test_obj(content: bytes) -> None:
    read(read_obj, "head.obj", content)


@fuzz
@given(st.binary(max_size=200))
def test_obj_of_any_bytes(content: bytes) -> None:
    read(read_obj, "head.obj", content)


@fuzz
@given(st.lists(MTL_LINES, max_size=20).map("\n".join).map(lambda text: text.encode(errors="surrogatepass")))
def test_mtl(content: bytes) -> None:
    read(read_mtl, "head.mtl", content)


@fuzz
@given(PLY_HEADERS, st.binary(max_size=120), st.lists(st.lists(NUMBERS, max_size=5), max_size=8))
def test_ply(header: list[str], binary: bytes, rows: list[list[str]]) -> None:
    text = "\n".join(["ply", *header, "end_header", *(" ".join(row) for row in rows)])
    read(lambda path: read_ply(path, path.parent), "head.ply", text.encode() + b"\n" + binary)


@fuzz
@given(st.binary(max_size=200))
def test_ply_of_any_bytes(content: bytes) -> None:
    read(lambda path: read_ply(path, path.parent), "head.ply", b"ply\n" + content)
