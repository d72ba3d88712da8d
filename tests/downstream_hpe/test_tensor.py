# SPDX-License-Identifier: MIT
from __future__ import annotations

import json

import ideal
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.geometry.face_mesh import TOPOLOGY
from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.tables.columns import ROTATION
from downstream_hpe.tables.missing import EXACT_COLUMNS, exact_in_pixels
from downstream_hpe.tables.open import SCHEMA_MAJOR, open_tables
from downstream_hpe.tables.rows import read_rows
from downstream_hpe.tables.tensor import open_tensor

HEADS = ("amy", "bob", "cid")
GONE = 7


@pytest.fixture
def heads():
    faces = ideal.Faces().draw(3, np.random.default_rng(1))
    return {name: ideal.rows(face, name) for name, face in zip(HEADS, faces, strict=True)}


@pytest.fixture
def dataset(tmp_path, heads):
    """bob's rows are split over two files whose names sort after and before the others."""
    half = {name: values[:60] for name, values in heads["bob"].items()}
    rest = {name: values[60:] for name, values in heads["bob"].items()}
    for name, columns in {"5": heads["amy"], "9": half, "1": rest, "6": heads["cid"]}.items():
        ideal.write(tmp_path / "data" / "train" / f"part-{name}.parquet", columns)
    ideal.write(tmp_path / "heads.parquet", {"subject": np.array(HEADS)}, {})
    return tmp_path


def write_heads(folder, heads):
    for name, columns in heads.items():
        ideal.write(folder / f"{name}.parquet", columns)
    return folder


def test_tensor_is_the_normalised_landmarks_of_each_cell(dataset, heads):
    tensor = open_tensor(dataset)
    assert tensor.heads == tuple(f"{name}/neutral" for name in HEADS)
    assert tensor.shape == (3, 5, 5, 5, 1404)
    values = tensor.to_array()
    for n, name in enumerate(HEADS):
        expected = normalise(heads[name]["landmarks"].reshape(-1, 468, 3))
        np.testing.assert_array_equal(values[n].reshape(expected.shape), expected)
    assert not tensor.report.cells
    np.testing.assert_array_equal(tensor.axes_deg[2], ideal.AXES[2])


def test_folders_called_key_value_are_folders(tmp_path, heads):
    folder = tmp_path / "seed=7" / "subject=x" / "expression=y" / "ds"
    ideal.write(folder / "data" / "train" / "part-1.parquet", heads["amy"])
    ideal.write(folder / "data" / "train" / "part-2.parquet", heads["bob"])
    ideal.write(folder / "heads.parquet", {"subject": np.array(["amy", "bob"])}, {})
    assert open_tensor(folder).heads == ("amy/neutral", "bob/neutral")
    assert set(read_rows(folder).subjects) == {"amy", "bob"}
    assert set(read_rows(folder / "data" / "train" / "part-1.parquet").subjects) == {"amy"}


def test_normalisations():
    landmarks = np.random.default_rng(0).normal(size=(4, 468, 3)) * 50 + 100
    paper = normalise(landmarks)
    np.testing.assert_allclose(paper.mean(axis=1), 0, atol=1e-12)
    np.testing.assert_allclose((paper**2).sum(-1).mean(-1), 1)
    code = normalise(landmarks, "eyes")
    np.testing.assert_allclose(code[:, 1], 0)
    np.testing.assert_allclose(np.linalg.norm(code[:, 33] - code[:, 263], axis=-1), 1)
    with pytest.raises(ValueError, match="coincide"):
        normalise(np.ones((468, 3)))


def test_missing_cells_are_refused_and_named(tmp_path, heads):
    ideal.drop(heads["bob"], GONE)
    heads["cid"] = {name: np.delete(values, 3, axis=0) for name, values in heads["cid"].items()}
    with pytest.raises(
        DataError, match=r"2 cells without landmarks \(1 of them without a row\): bob/neutral at yaw"
    ):
        open_tensor(write_heads(tmp_path, heads))


def test_kept_cells_are_nan_and_nothing_else_is(tmp_path, heads):
    ideal.drop(heads["bob"], GONE)
    tensor = open_tensor(write_heads(tmp_path, heads), missing="keep")
    values = tensor.to_array().reshape(3, -1, 1404)
    assert np.isnan(values[1, GONE]).all()
    assert np.isnan(values).sum() == 1404
    assert tensor.report.text().startswith("1 cells without landmarks left out of the fit")
    np.testing.assert_array_equal(tensor.observed, ~np.isnan(values[..., 0]).reshape(3, 5, 5, 5))


def test_turned_frontal_fills_rigid_heads_exactly(tmp_path, heads):
    true = open_tensor(write_heads(tmp_path / "whole", heads)).to_array()
    ideal.drop(heads["bob"], GONE)
    # Of cid the front itself is missing; the detection nearest to it is turned instead.
    ideal.drop(heads["cid"], 62)
    tensor = open_tensor(write_heads(tmp_path / "gaps", heads), missing="frontal")
    np.testing.assert_allclose(tensor.to_array(), true, atol=1e-5)
    assert len(tensor.report.cells) == 2


def test_the_front_need_not_be_a_cell_of_the_grid(tmp_path):
    axes = (np.array([-30.0, -10, 12, 30]), *ideal.AXES[1:])
    faces = ideal.Faces().draw(2, np.random.default_rng(1))
    uneven = {name: ideal.rows(face, name, axes) for name, face in zip("ab", faces, strict=True)}
    true = open_tensor(write_heads(tmp_path / "whole", uneven)).to_array()
    ideal.drop(uneven["a"], GONE)
    tensor = open_tensor(write_heads(tmp_path / "gaps", uneven), missing="frontal")
    np.testing.assert_allclose(tensor.to_array(), true, atol=1e-5)


def test_a_head_that_was_never_detected_can_be_filled_by_none_of_its_own(tmp_path, heads):
    for row in range(125):
        ideal.drop(heads["bob"], row)
    write_heads(tmp_path, heads)
    for missing in ("keep", "frontal"):
        with pytest.raises(DataError, match="bob/neutral was never detected"):
            open_tensor(tmp_path, missing=missing)
    with pytest.raises(UsageError, match="'skip' is none of fail, keep, exact, frontal"):
        open_tensor(tmp_path, missing="skip")


def camera_columns(count, projection, away):
    """K, pivot and projection of rows, as the generator writes them."""
    return {
        "camera": np.tile([800.0, 0, 128, 0, 800, 128, 0, 0, 1], (count, 1)),
        "translation_mm": np.tile([0.0, 0, away], (count, 1)),
        "projection": np.array([projection] * count),
    }


def test_missing_cells_are_filled_as_the_generator_fills_them(tmp_path, heads):
    theirs = pytest.importorskip("generator.dataset.format.missing")
    rng = np.random.default_rng(3)
    for columns in heads.values():
        points = columns["landmarks"].astype(float).reshape(-1, 468, 3) - 128
        exact = points + rng.normal(scale=2, size=points.shape) + [5, -9, 600]
        columns["landmarks_exact"] = exact.reshape(-1, 1404).astype(np.float32)
        columns |= camera_columns(len(points), "perspective", 640.0)
        columns["projection"] = np.where(np.arange(len(points)) % 2, "orthographic", "perspective")
    heads["amy"]["landmarks_exact"][5, :3] = np.nan  # a point without an anchor
    for row in (0, 62, 101):
        ideal.drop(heads["bob"], row)
    write_heads(tmp_path, heads)
    batches = list(open_tables(tmp_path, EXACT_COLUMNS).batches([*EXACT_COLUMNS, "subject"]))
    every = pq.read_table(tmp_path)
    ours = np.concatenate([exact_in_pixels(batch) for batch in batches])
    np.testing.assert_array_equal(ours, theirs.exact_in_pixels(every))
    gone = ~every["detected"].to_numpy()
    for missing, filled in (("exact", ours), ("frontal", theirs.rotated_frontal(every))):
        values = open_tensor(tmp_path, missing=missing).to_array().reshape(-1, 1404)
        expected = normalise(filled[gone].astype(float)).reshape(-1, 1404)
        np.testing.assert_allclose(values[gone], expected, atol=2e-6)


@pytest.mark.parametrize(("projection", "away"), [("orthographic", 700.0), ("perspective", 1e6)])
def test_exact_landmarks_fill_what_the_detector_missed(tmp_path, heads, projection, away):
    for columns in heads.values():
        # Seen from afar perspective, too, is the parallel projection the pixels were made with.
        points = columns["landmarks"].astype(float).reshape(-1, 468, 3) - 128
        columns["landmarks_exact"] = (points + np.array([0, 0, away])).reshape(-1, 1404)
        columns |= camera_columns(len(points), projection, away)
    true = open_tensor(write_heads(tmp_path / "whole", heads)).to_array()
    ideal.drop(heads["bob"], GONE)
    tensor = open_tensor(write_heads(tmp_path / "gaps", heads), missing="exact")
    np.testing.assert_allclose(tensor.to_array(), true, atol=1e-3 if projection == "perspective" else 1e-5)
    assert "filled from exact landmarks" in tensor.report.text()


def test_exact_without_its_column_says_so(dataset):
    with pytest.raises(DataError, match="no column landmarks_exact; choose --missing keep or frontal"):
        open_tensor(dataset, missing="exact")


def _without_landmarks(columns):
    del columns["landmarks"]


def _nan_though_detected(columns):
    columns["landmarks"][GONE, 5] = np.nan


def _other_rotation(columns):
    columns["rotation"] = columns["rotation"].reshape(-1, 3, 3).transpose(0, 2, 1).reshape(-1, 9)


def _two_rows_for_one_cell(columns):
    columns["yaw_index"][0] = columns["yaw_index"][-1]
    columns["yaw_deg"][0] = columns["yaw_deg"][-1]
    columns["pitch_index"][0] = columns["pitch_index"][-1]
    columns["pitch_deg"][0] = columns["pitch_deg"][-1]
    columns["roll_index"][0] = columns["roll_index"][-1]
    columns["roll_deg"][0] = columns["roll_deg"][-1]


def _two_grids(columns):
    columns["yaw_deg"] = columns["yaw_deg"] + 1


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (_without_landmarks, "no column landmarks"),
        (_nan_though_detected, "is detected but its landmarks are not finite"),
        (_other_rotation, "rotation of .* is not Rx"),
        (_two_rows_for_one_cell, "two rows for bob/neutral"),
        (_two_grids, "yaw_index 0 is -50° in one row and -49°"),
    ],
)
def test_bad_rows_end_in_one_line(tmp_path, heads, spoil, message):
    spoil(heads["bob"])
    with pytest.raises(DataError, match=message) as caught:
        open_tensor(write_heads(tmp_path, heads), missing="keep").to_array()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("headturn.schema_version", "2.0.0", "schema version 2.0.0, expected 1.x"),
        ("headturn.schema_version", "1.1.0", "schema_version differs"),
        ("headturn.landmark_topology", "dlib-68", "landmark topology dlib-68"),
        ("headturn.conventions", json.dumps({"rotation": "Rz Ry Rx"}), "rotation convention"),
        ("headturn.conventions", "{}", "names no rotation"),
        ("headturn.conventions", None, "no headturn.conventions in its metadata"),
    ],
)
def test_foreign_or_mixed_tables_are_refused(tmp_path, heads, key, value, message):
    ideal.write(tmp_path / "a.parquet", heads["amy"])
    metadata = {k: v for k, v in {**ideal.METADATA, key: value}.items() if v is not None}
    ideal.write(tmp_path / "b.parquet", heads["bob"], metadata)
    with pytest.raises(DataError, match=message):
        open_tensor(tmp_path)


def test_one_identity_nothing_there_and_no_parquet(tmp_path, heads):
    with pytest.raises(DataError, match="1 heads on a grid"):
        open_tensor(write_heads(tmp_path / "one", {"amy": heads["amy"]}))
    with pytest.raises(DataError, match="nowhere: not there"):
        open_tensor(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(DataError, match=r"no \.parquet file"):
        open_tensor(tmp_path / "empty")
    (tmp_path / "bad.parquet").write_bytes(b"PAR1 no")
    with pytest.raises(DataError, match="not a readable Parquet file"):
        open_tensor(tmp_path / "bad.parquet")
    ideal.write(tmp_path / "damaged.parquet", heads["amy"])
    damaged = bytearray((tmp_path / "damaged.parquet").read_bytes())
    damaged[4:20_000] = bytes(19_996)
    (tmp_path / "damaged.parquet").write_bytes(damaged)
    with pytest.raises(DataError, match=r"damaged\.parquet: damaged; headturn verify"):
        read_rows(tmp_path / "damaged.parquet")


def test_rows_leave_out_the_undetected_and_keep_the_split(tmp_path, heads):
    ideal.drop(heads["bob"], GONE)
    heads["cid"]["split"][:] = "validation"
    write_heads(tmp_path, heads)
    train = read_rows(tmp_path, "train")
    assert len(train) == 2 * 125 - 1
    assert train.undetected == 1
    assert set(train.subjects) == {"amy", "bob"}
    with pytest.raises(DataError, match="no row of split 'test'"):
        read_rows(tmp_path, "test")


def test_rows_without_a_face_are_partial_faces_of_what_is_seen(tmp_path, heads):
    rng = np.random.default_rng(4)
    for columns in heads.values():
        points = columns["landmarks"].astype(float).reshape(-1, 468, 3) - 128
        columns["landmarks_exact"] = (points + np.array([0, 0, 700.0])).reshape(-1, 1404)
        columns["landmarks_visible"] = rng.random((len(points), 468)) < 0.5
        columns |= camera_columns(len(points), "orthographic", 700.0)
    heads["bob"]["landmarks_visible"][8, 19:] = False  # too few
    visible = heads["bob"]["landmarks_visible"][GONE]
    expected = heads["bob"]["landmarks"][GONE].reshape(468, 3).copy()
    for row in (GONE, 8):
        ideal.drop(heads["bob"], row)
    write_heads(tmp_path, heads)
    found = read_rows(tmp_path, partial=True)
    assert (len(found), found.undetected) == (3 * 125 - 1, 1)
    partial = found.take(~found.complete)
    assert partial.heads.tolist() == ["bob/neutral"]
    np.testing.assert_array_equal(np.isnan(partial.landmarks[0]).all(axis=1), ~visible)
    # Both begin where their depth does.
    seen = partial.landmarks[0, visible]
    np.testing.assert_allclose(np.ptp(seen, axis=0), np.ptp(expected[visible], axis=0) * 800 / 700, rtol=1e-4)
    np.testing.assert_array_equal(found.take(found.complete).landmarks, read_rows(tmp_path).landmarks)


def test_partial_faces_need_exact_landmarks(dataset):
    with pytest.raises(DataError, match="no column landmarks_exact; leave out --partial"):
        read_rows(dataset, partial=True)


def test_the_contract_is_what_the_generator_writes(tmp_path):
    schema = pytest.importorskip("generator.dataset.format.schema")
    written = schema.part_schema("none", {}, "")
    assert written.metadata[b"headturn.schema_version"].decode().split(".")[0] == SCHEMA_MAJOR
    assert written.metadata[b"headturn.landmark_topology"].decode() == TOPOLOGY
    assert ROTATION in schema.CONVENTIONS["rotation"]
    pq.write_table(pa.Table.from_pylist([], schema=written), tmp_path / "empty.parquet")
    columns = ideal.rows(np.zeros((468, 3)), "nobody")
    assert open_tables(tmp_path, list(columns)).files
