# SPDX-License-Identifier: GPL-3.0-or-later
"""Landmarks of another kind: five points go all the way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import small_dataset
from small_dataset import HEADS, SMALL_PLAN

from generator.dataset.export.options import ExportOptions
from generator.dataset.export.run import export_dataset
from generator.dataset.format.anchors_table import HeadAnchors, read_anchors, write_anchors
from generator.dataset.format.manifest import (
    Manifest,
    configuration_digest,
    read_manifest,
    write_manifest,
)
from generator.dataset.format.open import as_array, dataset_topology
from generator.dataset.format.part import commit_unit, read_part
from generator.dataset.format.schema import part_schema
from generator.dataset.format.unit_rows import UnitRows, unit_table
from generator.dataset.proof.verify import verify_dataset
from generator.dataset.show.card import write_card
from generator.dataset.show.report.page import report_data
from generator.errors import DatasetError, UsageError
from generator.landmarks.topology import FACE_MESH, PointSubset, Topology
from generator.plan.first_settings import common_values
from generator.plan.pose_plans import PosePlans, poses_csv
from generator.registries import TOPOLOGIES

CORNERS = np.array([33, 263, 1, 61, 291])
FIVE = Topology(
    "five-points", 5, right_eye_outer=0, left_eye_outer=1, chin=2, nose_tip=2, parts={"mouth": (3, 4)}
)


@pytest.fixture(autouse=True)
def _registered() -> Iterator[None]:
    TOPOLOGIES.add(FIVE.name, FIVE)
    yield
    TOPOLOGIES.remove(FIVE.name)


def five_rows(head=HEADS[0], chosen: slice = slice(None)) -> UnitRows:
    rows = small_dataset.unit_rows(head, SMALL_PLAN, chosen)
    return replace(
        rows,
        landmarks=rows.landmarks[:, CORNERS],
        anchors=rows.anchors[CORNERS],
        visible=rows.visible[:, CORNERS],
        topology=FIVE,
    )


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    root = tmp_path / "d"
    root.mkdir()
    seen_by = {"resolution": 64, "distance_mm": small_dataset.CAMERA.distance_mm}
    configuration = {"render": seen_by}
    digest = configuration_digest(common_values(configuration))
    schema = part_schema("files", small_dataset.VERSIONS, digest, FIVE)
    parts = [commit_unit(five_rows(head), schema, root, head.subject) for head in HEADS]
    small_dataset.write_heads([replace(head, anchor_absent=0) for head in HEADS], root)
    points = five_rows().anchors
    write_anchors(
        [HeadAnchors(h.subject, h.expression, np.arange(5), np.full((5, 3), 1 / 3), points) for h in HEADS],
        root,
    )
    (root / "poses.csv").write_text(poses_csv(PosePlans(SMALL_PLAN)))
    manifest = Manifest(small_dataset.VERSIONS, configuration, tuple(parts), "files", 2)
    write_card(manifest, root)
    write_manifest(manifest, root)
    return root


def test_five_points_from_unit_to_array(dataset: Path) -> None:
    table = read_part(dataset / "data/train/part-s1.parquet")
    assert as_array(table, "landmarks").shape == as_array(table, "landmarks_exact").shape == (18, 5, 3)
    assert as_array(table, "landmarks_visible").shape == (18, 5)
    np.testing.assert_array_equal(as_array(table, "landmarks"), five_rows().landmarks)
    assert pq.read_schema(dataset / "data/train/part-s1.parquet").metadata[b"headturn.landmark_topology"] == (
        b"five-points"
    )
    assert dataset_topology(dataset, read_manifest(dataset)) is FIVE
    assert read_anchors(dataset)["s1", "neutral"].points.shape == (5, 3)


def test_five_points_are_verified_and_shown(dataset: Path) -> None:
    report = verify_dataset(dataset, workers=1)
    assert report.ok, report.text()
    assert 0 < report.closure_deg < 1e-4
    data = report_data(dataset, lambda _: None)
    assert data["regions"] == ["whole face", "mouth"] and data["heads"][0]["anchors"] == 5
    assert len(data["sheet"]["tiles"][0][0]["exact"]) == 2 * 2  # the two points of the mouth
    assert "5 x (x, y, z)" in (dataset / "README.md").read_text()
    assert "| landmarks | float32[15] |" in (dataset / "README.md").read_text()


def test_five_points_are_exported_where_nobody_needs_68(dataset: Path, tmp_path: Path) -> None:
    assert export_dataset(dataset, "huggingface", tmp_path / "h").rows == 36
    assert export_dataset(dataset, "biwi", tmp_path / "b").rows == 36
    with pytest.raises(UsageError, match=r"coco holds the 68 points of iBUG, which the landmarks five-point"):
        export_dataset(dataset, "coco", tmp_path / "c", ExportOptions())
    assert not (tmp_path / "c").exists()


def test_a_part_of_other_landmarks_is_found(dataset: Path) -> None:
    path = dataset / "data/train/part-s1.parquet"
    table = pq.read_table(path)
    name = {b"headturn.landmark_topology": FACE_MESH.name.encode()}
    pq.write_table(table.replace_schema_metadata({**table.schema.metadata, **name}), path)
    [wrong] = [check for check in verify_dataset(dataset, workers=1).checks if check.name == "schema"]
    assert "landmark_topology is" in wrong.detail


def test_landmarks_that_nobody_registered(dataset: Path) -> None:
    TOPOLOGIES.remove(FIVE.name)
    report = verify_dataset(dataset, workers=1)
    TOPOLOGIES.add(FIVE.name, FIVE)
    [wrong] = [check for check in report.checks if check.count]
    assert "part-s1.parquet: landmark topology 'five-points': expected one of mediapipe" in wrong.detail
    with pytest.raises(DatasetError, match=r"landmark topology 'five-points'"):
        TOPOLOGIES.remove(FIVE.name)
        try:
            report_data(dataset, lambda _: None)
        finally:
            TOPOLOGIES.add(FIVE.name, FIVE)


def test_rows_and_schema_have_to_agree() -> None:
    with pytest.raises(ValueError, match="the rows have the landmarks five-points, the schema has others"):
        unit_table(five_rows(), part_schema("none", {}, ""))
    with pytest.raises(ValueError, match=r"landmarks: expected shape \(18, 468, 3\), got \(18, 5, 3\)"):
        replace(five_rows(), topology=FACE_MESH)


def test_a_topology_without_a_mean_face_says_so() -> None:
    with pytest.raises(ValueError, match="five-points have no mean face"):
        FIVE.reference_face()


def test_the_face_mesh_agrees_with_itself() -> None:
    assert FACE_MESH.count == len(FACE_MESH.reference_face()) == 468
    assert FACE_MESH.mirror_pairs()[33] == 263
    assert TOPOLOGIES.get(FACE_MESH.name) is FACE_MESH


def test_a_subset_draws_its_lines() -> None:
    ring = PointSubset("ring", {"a": (5, 6, 7), "b": (1, 2)}, frozenset("a"))
    assert ring.skeleton == ((0, 1), (1, 2), (2, 0), (3, 4))
    assert ring.names == ("a_1", "a_2", "a_3", "b_1", "b_2") and ring.indices.tolist() == [5, 6, 7, 1, 2]
