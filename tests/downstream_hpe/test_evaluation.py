# SPDX-License-Identifier: MIT
from __future__ import annotations

import csv

import ideal
import numpy as np
import pytest

from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.estimators import constant_zero, rigid_fit
from downstream_hpe.evaluation.plots import interval_figure, write_plots
from downstream_hpe.evaluation.reference import load_reference, mean_face
from downstream_hpe.evaluation.scores import evaluate, markdown, within_bounds, write_csv
from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.tables.rows import Rows
from downstream_hpe.tables.splits import split_subjects


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


@pytest.mark.slow
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
    write_plots(results, tmp_path)
    for name in ("error_by_interval.png", "error_distribution.png"):
        assert (tmp_path / name).read_bytes().startswith(b"\x89PNG")


def test_an_interval_without_rows_is_no_bar(rows):
    level = rows.take(rows.ypr_deg[:, 2] == 0)
    results = [
        evaluate("zero", constant_zero(level.landmarks), level.rotation),
        evaluate("pitch off by 3", level.ypr_deg + np.array([0, 3, 0]), level.rotation),
        evaluate("roll off by 2", level.ypr_deg + np.array([0, 0, 2]), level.rotation),
    ]
    yaw, pitch, roll = interval_figure(results).axes
    for panel, expected in ((yaw, [15, 15, 0, 15, 15, 15]), (roll, [0, 0, 0, 75, 0, 0])):
        assert [label.get_text() for label in panel.get_xticklabels(minor=True)] == list(map(str, expected))
        hatched = sorted(patch.get_x() + 0.5 for patch in panel.patches if patch.get_hatch())
        assert hatched == [k for k, count in enumerate(expected) if not count]
        for bars in panel.containers:
            assert [np.isfinite(bar.get_height()) for bar in bars] == [count > 0 for count in expected]
    # The constant answer is cut off and says its value; an estimate without error says so, too.
    assert pitch.get_ylim()[1] < 4
    assert [text.get_text() for text in pitch.texts if text.get_position()[0] < -0.2] == ["40"]
    assert [text.get_text() for text in roll.texts] == ["0", "0"]


def test_what_cannot_be_evaluated_is_refused(rows):
    with pytest.raises(DataError, match="not finite"):
        evaluate("nan", np.full((len(rows), 3), np.nan), rows.rotation)
    with pytest.raises(DataError, match="expected"):
        evaluate("short", np.zeros((2, 3)), rows.rotation)
    assert within_bounds(np.array([[50, 40, 30], [0, 41, 0]])).tolist() == [True, False]
