# SPDX-License-Identifier: GPL-3.0-or-later
"""FaceScape is read at every layout seen in the wild, traps included."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from facescape_fixture import NAMES, fixture_head, write_download, write_subject

from generator.errors import UsageError
from generator.heads.describe import describe_source
from generator.heads.facescape import EXPRESSIONS
from generator.heads.read import read_mesh
from generator.heads.source import find_heads


@pytest.fixture(scope="module")
def download(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_download(tmp_path_factory.mktemp("facescape"))


def test_a_real_layout_gives_subjects_licence_and_skipped_files(download: Path) -> None:
    source = find_heads(download)
    assert source.kind == "facescape"
    assert [head.name for head in source.heads] == [
        "facescape-66/neutral",
        "facescape-66/smile",
        "facescape-122/neutral",
        "facescape-360/neutral",
    ]
    assert [head.redistributable for head in source.heads] == [False, False, True, False]
    assert ["portraits of this subject" in head.attribution for head in source.heads] == [
        head.redistributable for head in source.heads
    ]
    assert all(
        (h.license, h.units, h.up, h.forward) == ("LicenseRef-FaceScape", "mm", "+Y", "+Z")
        for h in source.heads
    )
    assert [bool(head.problems) for head in source.heads] == [False, False, False, True]
    assert "mosaicked" in source.heads[3].problems[0]
    (skip,) = source.skipped
    assert (skip.subject, skip.expression) == ("facescape-66", "mouth_stretch")
    assert "3_mouth_stretch.jpg" in skip.reason


@pytest.mark.parametrize(
    "folder",
    [
        "facescape_trainset_001_100/7/models_reg",
        "7/models_reg",
        "7",
        "001_100/7",
        "zips/part1/facescape_trainset_001_100/7/models_reg",
    ],
)
@pytest.mark.parametrize("start", ["top", "subject", "meshes", "file"])
def test_every_layout_from_every_starting_point(tmp_path: Path, folder: str, start: str) -> None:
    meshes = tmp_path / folder
    write_subject(meshes)
    subject = meshes.parent if meshes.name == "models_reg" else meshes
    path = {"top": tmp_path, "subject": subject, "meshes": meshes, "file": meshes / "1_neutral.obj"}[start]
    (head,) = find_heads(path).heads
    assert (head.name, head.source) == ("facescape-7/neutral", "facescape")
    assert head.files == (meshes / "1_neutral.obj", meshes / "1_neutral.jpg")


def test_ids_sort_as_numbers_and_a_second_copy_is_skipped(tmp_path: Path) -> None:
    for folder in ("a/10", "a/9", "a/100", "b/9"):
        write_subject(tmp_path / folder)
    source = find_heads(tmp_path)
    assert [head.subject for head in source.heads] == ["facescape-9", "facescape-10", "facescape-100"]
    assert [skip.subject for skip in source.skipped] == ["facescape-9"]


@pytest.mark.parametrize("text", ["smile", "2", "2_smile", "Smile"])
def test_expressions_by_name_or_number(download: Path, text: str) -> None:
    source = find_heads(download, expressions=[text])
    assert [head.name for head in source.heads] == ["facescape-66/smile"]
    assert {skip.subject for skip in source.skipped} == {"facescape-122", "facescape-360"}


def test_an_unknown_expression_lists_those_that_exist(download: Path) -> None:
    with pytest.raises(UsageError, match=r"'frown'.*neutral, smile, mouth_stretch$"):
        find_heads(download, expressions=["frown"])
    assert NAMES == EXPRESSIONS


def test_the_licence_cannot_be_widened(download: Path) -> None:
    with pytest.raises(UsageError, match="licence"):
        find_heads(download, redistributable=True)
    with pytest.raises(UsageError, match="licence"):
        find_heads(download, license="CC0-1.0")
    assert not any(head.redistributable for head in find_heads(download, redistributable=False).heads)


def test_a_mesh_without_obj_is_skipped_and_foreign_files_too(tmp_path: Path) -> None:
    write_subject(tmp_path / "5", (1, 2))
    (tmp_path / "5" / "2_smile.obj").unlink()
    shutil.copy(tmp_path / "5" / "1_neutral.obj", tmp_path / "5" / "3_smile.obj")
    source = find_heads(tmp_path)
    assert [head.expression for head in source.heads] == ["neutral"]
    assert {skip.path.name: skip.reason for skip in source.skipped} == {
        "2_smile.obj": "the mesh 2_smile.obj is missing",
        "3_smile.obj": "not one of FaceScape's 20 expressions",
    }


def test_one_texture_a_subject_is_found_through_the_mtl(tmp_path: Path) -> None:
    write_subject(tmp_path / "5", (1,))
    (tmp_path / "5" / "1_neutral.jpg").rename(tmp_path / "5" / "skin.jpg")
    (tmp_path / "5" / "1_neutral.obj.mtl").write_text("newmtl material_0\nKd 0 0 0\nmap_Kd skin.jpg\n")
    (head,) = find_heads(tmp_path).heads
    assert head.files[-1].name == "skin.jpg"


def test_the_mesh_is_textured_in_spite_of_black_kd_and_has_eyes_and_mouth(
    download: Path, tmp_path: Path
) -> None:
    head = find_heads(download).heads[0]
    mesh = read_mesh(head, tmp_path)
    assert [material.name for material in mesh.materials] == ["material_0", "eye", "lid", "mouth"]
    assert mesh.materials[0].texture == head.files[-1]
    assert not mesh.problems
    scanned = fixture_head()
    triangles = mesh.triangles[mesh.material_index == 0]
    assert 1.98 * len(scanned.quads) < len(triangles) <= 2 * len(scanned.quads)
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), np.ptp(scanned.vertices, axis=0), atol=1e-3)
    assert mesh.uv is not None
    assert mesh.uv[mesh.material_index == 0].std() > 0.1


def test_the_image_beside_the_mesh_is_the_texture_whatever_the_mtl_says(tmp_path: Path) -> None:
    write_subject(tmp_path / "5")
    (tmp_path / "5" / "1_neutral.obj.mtl").write_text("newmtl material_0\nKd 0 0 0\nKs 1 1 1\n")
    (head,) = find_heads(tmp_path).heads
    assert read_mesh(head, tmp_path).materials[0].texture == tmp_path / "5" / "1_neutral.jpg"


def test_a_texture_that_is_no_image_costs_one_head(tmp_path: Path) -> None:
    write_subject(tmp_path / "1")
    write_subject(tmp_path / "2")
    (tmp_path / "1" / "1_neutral.jpg").write_bytes(b"<html>404</html>")
    rows = describe_source(find_heads(tmp_path), deep=True)
    assert [row["vertices"] is None for row in rows] == [True, False]
    assert "1_neutral.jpg is not an image" in rows[0]["problems"][0]
    assert rows[1]["texture"] == [256, 256]


def test_all_847_subjects_are_listed_without_opening_a_file(tmp_path: Path) -> None:
    # Empty files: a scan that parsed or decoded anything would report problems.
    for number in range(1, 848, 40):
        folder = tmp_path / str(number) / "models_reg"
        folder.mkdir(parents=True)
        for k, name in enumerate(NAMES, 1):
            for suffix in (".obj", ".jpg", ".obj.mtl"):
                (folder / f"{k}_{name}{suffix}").touch()
    source = find_heads(tmp_path)
    assert len(source.heads) == 22 * 20
    assert not source.skipped
