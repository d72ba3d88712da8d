# SPDX-License-Identifier: GPL-3.0-or-later
"""Files of other kinds: read, or skipped with the way out."""

from __future__ import annotations

import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
import trimesh
from small_meshes import plain_obj

from generator.errors import HeadError, UsageError
from generator.heads.mesh import HeadMesh
from generator.heads.read import read_mesh
from generator.heads.source import find_heads


def read(path: Path, scratch: Path) -> HeadMesh:
    scratch.mkdir()
    (head,) = find_heads(path).heads
    return read_mesh(head, scratch)


@pytest.mark.parametrize("ascii_form", [False, True])
def test_stl_is_triangles_that_share_their_vertices(tmp_path: Path, ascii_form: bool) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.export(tmp_path / "head.stl", file_type="stl_ascii" if ascii_form else "stl")
    mesh = read(tmp_path / "head.stl", tmp_path / "scratch")
    assert (len(mesh.vertices), len(mesh.triangles)) == (42, 80)
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), a) > 0).all(), "the outside stays outside"
    assert "no colours" in mesh.problems[0]


@pytest.mark.parametrize(
    "data",
    [b"", b"solid x\n", b"solid x\nfacet\nvertex 1 2\n", bytes(80) + struct.pack("<I", 1 << 31), bytes(500)],
)
def test_an_stl_that_is_none_is_refused_in_a_line(tmp_path: Path, data: bytes) -> None:
    (tmp_path / "head.stl").write_bytes(data)
    with pytest.raises(HeadError, match=r"head\.stl: [^\n]+$"):
        read(tmp_path / "head.stl", tmp_path / "scratch")


def test_vrm_is_a_glb(tmp_path: Path) -> None:
    trimesh.Scene(trimesh.creation.icosphere(subdivisions=1)).export(tmp_path / "head.glb")
    (tmp_path / "head.glb").rename(tmp_path / "head.vrm")
    assert len(read(tmp_path / "head.vrm", tmp_path / "scratch").triangles) == 80


@pytest.mark.parametrize("name", ["anna.x3d", "anna.ABC", "anna.3ds"])
def test_what_is_not_read_is_skipped_with_the_way_out(tmp_path: Path, name: str) -> None:
    plain_obj(tmp_path / "good.obj")
    (tmp_path / name).write_bytes(b"x")
    for path in (tmp_path, tmp_path / name):
        source = find_heads(path)
        (skip,) = source.skipped
        kind = Path(name).suffix[1:].upper()
        assert skip.subject == "anna"
        assert skip.reason.startswith(f"{kind} is not read; open the file in ")
        assert skip.reason.endswith("and export it as GLB")
    assert len(find_heads(tmp_path).heads) == 1


def test_a_scene_among_other_heads_is_a_source_of_its_own(tmp_path: Path) -> None:
    plain_obj(tmp_path / "good.obj")
    (tmp_path / "anna.blend").write_bytes(b"BLENDER")
    source = find_heads(tmp_path)
    assert len(source.heads) == 1
    assert [skip.reason for skip in source.skipped] == [
        "anna.blend is a scene, and a source of its own: headturn build anna.blend"
    ]


def test_a_head_that_comes_in_a_format_that_is_read_too_is_not_skipped(tmp_path: Path) -> None:
    plain_obj(tmp_path / "anna.obj")
    shutil.copy(tmp_path / "anna.obj", tmp_path / "anna.blend")
    source = find_heads(tmp_path)
    assert (len(source.heads), source.skipped) == (1, ())


@pytest.mark.parametrize("name", ["more.zip", "more.tar.gz", "bob.obj.gz"])
def test_an_archive_beside_heads_is_named_unless_it_was_unpacked(tmp_path: Path, name: str) -> None:
    plain_obj(tmp_path / "anna.obj")
    (tmp_path / name).write_bytes(b"PK\3\4")
    source = find_heads(tmp_path)
    assert len(source.heads) == 1
    (skip,) = source.skipped
    assert skip.reason == f"{name} is an archive; unpack it here"
    plain_obj(tmp_path / "bob.obj" if name.startswith("bob") else tmp_path / "more" / "bob.obj")
    source = find_heads(tmp_path)
    assert (len(source.heads), source.skipped) == (2, ())


@pytest.mark.parametrize("name", ["a.zip", "source/a.ZIP", "x/y/a.7z"])
def test_a_download_with_nothing_but_archives_says_which(tmp_path: Path, name: str) -> None:
    (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / name).write_bytes(b"PK\3\4")
    with pytest.raises(UsageError) as error:
        find_heads(tmp_path)
    assert f"but the archive {name}: unpack it first" in str(error.value)


@pytest.mark.parametrize("name", ["heads.zip", "heads.7z"])
def test_an_archive_is_to_be_unpacked(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(b"PK\3\4")
    with pytest.raises(UsageError, match="is an archive: unpack it"):
        find_heads(tmp_path / name)
