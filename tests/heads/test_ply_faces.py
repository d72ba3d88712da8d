# SPDX-License-Identifier: GPL-3.0-or-later
"""PLY files whose triangles are strips, and whose faces have colours."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from generator.errors import HeadError
from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

VERTICES = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 2, 0)]
RGB = "property uchar red\nproperty uchar green\nproperty uchar blue\n"


def ply(
    folder: Path, elements: str, body: str, *, vertex: str = "", values: str = "", form: str = "ascii"
) -> Path:
    header = f"ply\nformat {form} 1.0\nelement vertex {len(VERTICES)}\n"
    header += "".join(f"property float {axis}\n" for axis in "xyz") + vertex + elements + "end_header\n"
    lines = "".join(f"{x} {y} {z} {values.format(x=x, y=y)}\n" for x, y, z in VERTICES)
    (folder / "head.ply").write_text(header + lines + body)
    return folder / "head.ply"


def read(path: Path, scratch: Path) -> HeadMesh:
    scratch.mkdir()
    (head,) = find_heads(path).heads
    return read_mesh(head, scratch)


STRIPS = "element tristrips {}\nproperty list int int vertex_indices\n"
OUTSIDE_UP = [[0, 1, 3], [3, 1, 2], [3, 2, 4]]


@pytest.mark.parametrize(
    ("count", "body", "expected"),
    [
        (1, "5 0 1 3 2 -1\n", OUTSIDE_UP[:2]),
        (1, "4 0 1 3 2\n", OUTSIDE_UP[:2]),
        (1, "8 0 1 3 2 -1 3 2 4\n", OUTSIDE_UP),
        (1, "9 0 1 3 -1 3 1 2 -1 -1\n", OUTSIDE_UP[:2]),
        (2, "4 0 1 3 2\n3 3 2 4\n", OUTSIDE_UP),
    ],
)
def test_strips_are_triangles_that_face_outside(
    tmp_path: Path, count: int, body: str, expected: list[list[int]]
) -> None:
    mesh = read(ply(tmp_path, STRIPS.format(count), body), tmp_path / "scratch")
    assert mesh.triangles.tolist() == expected


def test_binary_strips_with_a_texture(tmp_path: Path) -> None:
    Image.new("RGB", (4, 4)).save(tmp_path / "skin.png")
    header = "ply\nformat binary_little_endian 1.0\ncomment TextureFile skin.png\nelement vertex 5\n"
    header += "".join(f"property float {name}\n" for name in "xyzuv") + STRIPS.format(1) + "end_header\n"
    data = b"".join(struct.pack("<5f", *point, point[0] / 2, point[1] / 2) for point in VERTICES)
    data += struct.pack("<6i", 5, 0, 1, 3, 2, -1)
    (tmp_path / "head.ply").write_bytes(header.encode() + data)
    mesh = read(tmp_path / "head.ply", tmp_path / "scratch")
    assert mesh.materials[0].texture == tmp_path / "skin.png"
    assert mesh.uv is not None
    np.testing.assert_allclose(mesh.uv, mesh.vertices[mesh.triangles][..., :2] / 2)


@pytest.mark.parametrize(("body", "reason"), [("2 0 1\n", "no triangle"), ("3 0 1 9\n", "outside of 0 to 4")])
def test_strips_that_are_none_are_refused(tmp_path: Path, body: str, reason: str) -> None:
    with pytest.raises(HeadError, match=reason):
        read(ply(tmp_path, STRIPS.format(1), body), tmp_path / "scratch")


@pytest.mark.parametrize(
    "body", ["4 0 1 2 3 200 100 50\n3 3 2 4 0 0 9\n", "3 0 1 2 200 100 50\n3 3 2 4 0 0 9\n"]
)
def test_each_face_is_drawn_in_its_colour(tmp_path: Path, body: str) -> None:
    faces = "element face 2\nproperty list uchar int vertex_indices\n" + RGB
    mesh = read(ply(tmp_path, faces, body), tmp_path / "scratch")
    (material,) = mesh.materials
    assert material.texture is not None and mesh.uv is not None
    assert not mesh.problems
    with Image.open(material.texture) as image:
        pixels = np.asarray(image)
    height, width = pixels.shape[:2]
    middle = mesh.uv.mean(axis=1)
    drawn = pixels[((1 - middle[:, 1]) * height).astype(int), (middle[:, 0] * width).astype(int)].tolist()
    assert drawn == [[200, 100, 50]] * (len(drawn) - 1) + [[0, 0, 9]]


def test_vertex_colours_go_before_those_of_faces(tmp_path: Path) -> None:
    faces = "element face 1\nproperty list uchar int vertex_indices\n" + RGB
    path = ply(tmp_path, faces, "3 0 1 2 1 2 3\n", vertex=RGB, values="255 0 0")
    mesh = read(path, tmp_path / "scratch")
    assert mesh.vertex_colors is not None
    assert mesh.vertex_colors.tolist() == [[1, 0, 0]] * 3
    assert mesh.materials[0].texture is None
