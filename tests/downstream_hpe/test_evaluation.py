# SPDX-License-Identifier: MIT
from __future__ import annotations

import csv

import ideal
import numpy as np
import pytest

from downstream_hpe.errors import DataError
from downstream_hpe.evaluation import (
    constant_zero,
    evaluate,
    markdown,
    plot_distribution,
    plot_intervals,
    rigid_fit,
    split_subjects,
    within_bounds,
    write_csv,
)
from downstream_hpe.normalise import normalise
from downstream_hpe.reference import load_reference, mean_face
from downstream_hpe.rotation import rotation_from_angles
from downstream_hpe.tables import Rows


@pytest.fixture(scope="module")
def rows():
    rng = np.random.default_rng(1)
    ypr = np.stack(np.meshgrid(*ideal.AXES, indexing="ij"), axis=-1).reshape(-1, 3)
    faces = ideal.Faces().draw(3, rng)
    every = [ideal.turned(np.broadcast_to(face, (len(ypr), 468, 3)), ypr) for face in faces]
    heads = np.repeat(["a/n", "b/n", "c/n"], len(ypr))
    tiled = np.tile(ypr, (3, 1))
    return Rows(heads, heads, tiled, rotation_from_angles(tiled), np.concatenate(every), 0)


def test_errors_by_interval_cover_every_row_once(rows):
    wrong = rows.ypr_deg + np.array([0, 3, 0])
    result = evaluate("pitch off by 3", wrong, rows.rotation)
    np.testing.assert_allclose(result.mae, [0, 3, 0], atol=1e-9)
    np.testing.assert_allclose(result.geodesic, 3.0)
    np.testing.assert_allclose(result.mean_mae, 1.0)
    for angle, mae in (("yaw", 0), ("pitch", 3)):
        mine = [i for i in result.intervals if i.angle == angle]
        assert [i.count for i in mine] == [75, 75, 0, 75, 75, 75]
        assert sum(i.count for i in mine) == len(rows)
        np.testing.assert_allclose([i.mae for i in mine if i.count], mae, atol=1e-9)
        assert np.isnan(mine[2].mae)


def test_constant_zero_scores_the_mean_angle(rows):
    result = evaluate("zero", constant_zero(rows.landmarks), rows.rotation)
    np.testing.assert_allclose(result.mae, np.abs(rows.ypr_deg).mean(axis=0))


def test_rigid_fit_to_the_mean_face_is_level(rows):
    reference = mean_face(rows)
    result = evaluate("rigid", rigid_fit(reference)(rows.landmarks), rows.rotation)
    assert result.geodesic < 2.0
    one = rows.take(rows.heads == "a/n")
    alone = evaluate("own face", rigid_fit(mean_face(one))(one.landmarks), one.rotation)
    assert alone.geodesic < 1e-4


def test_reference_face_from_files(tmp_path, rows):
    face = normalise(np.random.default_rng(0).normal(size=(468, 3)))
    face[10, 1], face[152, 1], face[1, 2] = -2, 2, -3
    np.savez(tmp_path / "face.npz", face)
    np.savetxt(tmp_path / "face.csv", face, delimiter=",")
    expected = normalise(face)
    for name in ("face.npz", "face.csv"):
        np.testing.assert_allclose(load_reference(tmp_path / name), expected, atol=1e-12)
    np.savez(tmp_path / "up.npz", face * [1, -1, -1])
    np.testing.assert_allclose(load_reference(tmp_path / "up.npz"), expected, atol=1e-12)
    np.savez(tmp_path / "mirrored.npz", face * [1, -1, 1])
    with pytest.raises(DataError, match="a mirrored face"):
        load_reference(tmp_path / "mirrored.npz")
    np.savez(tmp_path / "small.npz", face[:68])
    with pytest.raises(DataError, match=r"got shape \(68, 3\)"):
        load_reference(tmp_path / "small.npz")
    (tmp_path / "bad.npz").write_bytes(b"no")
    with pytest.raises(DataError, match="not readable"):
        load_reference(tmp_path / "bad.npz")


def test_split_never_divides_a_subject():
    subjects = np.repeat([f"s{i}" for i in range(20)], 7)
    held = split_subjects(subjects, 0.25)
    assert held.sum() == 5 * 7
    assert not set(subjects[held]) & set(subjects[~held])
    np.testing.assert_array_equal(held, split_subjects(subjects, 0.25))
    assert (held != split_subjects(subjects, 0.25, seed=1)).any()
    with pytest.raises(DataError, match="1 subjects"):
        split_subjects(subjects[:7], 0.25)


def test_tables_and_plots(tmp_path, rows):
    results = [
        evaluate("zero", constant_zero(rows.landmarks), rows.rotation),
        evaluate("true", rows.ypr_deg, rows.rotation),
    ]
    text = markdown(results)
    assert "| true | 375 | 0.00 | 0.00 | 0.00 | 0.00 | 0.00 | 0.00 |" in text
    assert "| yaw | -50 to -33.33 | 75 | 50.00 | 0.00 |" in text
    write_csv(results, tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    assert len(lines) == 2 * (1 + 3 + 18)
    assert lines[0]["angle"] == "all"
    plot_intervals(results, tmp_path / "i.png")
    plot_distribution(results, tmp_path / "d.png")
    for name in ("i.png", "d.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_what_cannot_be_evaluated_is_refused(rows):
    with pytest.raises(DataError, match="not finite"):
        evaluate("nan", np.full((len(rows), 3), np.nan), rows.rotation)
    with pytest.raises(DataError, match="expected"):
        evaluate("short", np.zeros((2, 3)), rows.rotation)
    assert within_bounds(np.array([[50, 40, 30], [0, 41, 0]])).tolist() == [True, False]
