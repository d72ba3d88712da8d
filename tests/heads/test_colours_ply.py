# SPDX-License-Identifier: GPL-3.0-or-later
"""The colour drawn is the colour that a PLY names, or it is said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from generator.errors import HeadError
from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

UV = {0: "0 0", 1: "1 0", 2: "1 1", 3: "0 1"}


def textured(folder: Path, faces: list[tuple[list[int], int]], *, numbered: bool = True) -> Path:
    """A square of faces (corners, number of the texture), with a.png and b.png."""
    text = "ply\nformat ascii 1.0\ncomment TextureFile a.png\ncomment TextureFile b.png\nelement vertex 4\n"
    text += "".join(f"property float {axis}\n" for axis in "xyz") + f"element face {len(faces)}\n"
    text += "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
    text += "property int texnumber\n" * numbered + "end_header\n-1 -1 0\n1 -1 0\n1 1 0\n-1 1 0\n"
    for corners, number in faces:
        uv = " ".join(UV[corner] for corner in corners)
        row = f"{len(corners)} {' '.join(map(str, corners))} {2 * len(corners)} {uv}"
        text += f"{row} {number}\n" if numbered else f"{row}\n"
    (folder / "head.ply").write_text(text)
    for name in "ab":
        Image.new("RGB", (2, 2)).save(folder / f"{name}.png")
    return folder / "head.ply"


def read(path: Path) -> HeadMesh:
    (head,) = find_heads(path).heads
    return read_mesh(head, path.parent)


def drawn(mesh: HeadMesh) -> list[str]:
    """The texture of each triangle."""
    return [str(mesh.materials[number].texture)[-5:] for number in mesh.material_index]


def test_each_face_has_the_texture_of_its_number(tmp_path: Path) -> None:
    path = textured(tmp_path, [([0, 1, 2], 1), ([0, 2, 3], 0)])
    assert drawn(read(path)) == ["b.png", "a.png"]
    (head,) = find_heads(path).heads
    assert [file.name for file in head.files] == ["head.ply", "a.png", "b.png"]


def test_quads_keep_theirs(tmp_path: Path) -> None:
    mesh = read(textured(tmp_path, [([0, 1, 2, 3], 1), ([3, 2, 1, 0], 0)]))
    front = np.cross(*(np.diff(mesh.vertices[mesh.triangles], axis=1).swapaxes(0, 1)))[:, 2] > 0
    assert drawn(mesh) == ["b.png" if towards else "a.png" for towards in front]
    assert front.sum() == 2


@pytest.mark.parametrize(
    ("faces", "numbered", "reason"),
    [
        ([([0, 1, 2], 0), ([0, 2, 3], 2)], True, "a face has a texnumber outside of 0 to 1"),
        ([([0, 1, 2], 0), ([0, 2, 3], -1)], True, "a face has a texnumber outside of 0 to 1"),
        ([([0, 1, 2], 0), ([0, 2, 3], 0)], False, "several textures, but no face its texnumber"),
    ],
)
def test_faces_without_a_texture_of_theirs_are_refused(
    tmp_path: Path, faces: list[tuple[list[int], int]], numbered: bool, reason: str
) -> None:
    with pytest.raises(HeadError, match=reason):
        read(textured(tmp_path, faces, numbered=numbered))


def test_a_texture_that_is_missing_refuses(tmp_path: Path) -> None:
    path = textured(tmp_path, [([0, 1, 2], 1)])
    (tmp_path / "b.png").unlink()
    assert "'b.png' is missing" in find_heads(path).skipped[0].reason


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("uchar", "255 51 0", (1, 0.2, 0)),
        ("uchar", "2 1 0", (2 / 255, 1 / 255, 0)),
        ("ushort", "65535 13107 0", (1, 0.2, 0)),
        ("ushort", "255 51 0", (1, 0.2, 0)),
        ("int", "255 51 0", (1, 0.2, 0)),
        ("float", "1.0000001 0.2 0", (1, 0.2, 0)),
        ("float", "255 51 0", (1, 0.2, 0)),
    ],
)
def test_the_range_of_vertex_colours(
    tmp_path: Path, kind: str, values: str, expected: tuple[float, ...]
) -> None:
    text = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    text += "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
    text += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    text += "".join(f"{corner} {values}\n" for corner in ("0 0 0", "1 0 0", "0 1 0")) + "3 0 1 2\n"
    (tmp_path / "head.ply").write_text(text)
    colors = read(tmp_path / "head.ply").vertex_colors
    assert colors is not None
    np.testing.assert_allclose(colors, [expected] * 3, atol=1e-5)
