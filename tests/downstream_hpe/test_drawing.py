# SPDX-License-Identifier: MIT
"""Drawn poses and tables of them; how they look is judged by eye."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.prediction.drawing import draw_faces
from downstream_hpe.prediction.face import Face
from downstream_hpe.prediction.records import COLUMNS, RecordWriter, record, text


def face(size=100.0, confidence=0.9, in_range=True, ypr=(30.0, 10, 5), index=0):
    landmarks = np.random.default_rng(0).uniform(0, size, size=(468, 3)) + np.array([60, 60, 0])
    ypr_deg = np.array(ypr)
    return Face(index, landmarks, rotation_from_angles(ypr_deg), ypr_deg, confidence, in_range)


def strongest(drawn, channel):
    """How far the colour stands above the other two, at most."""
    pixels = drawn.astype(int)
    return (pixels[..., channel] - np.delete(pixels, channel, axis=-1).max(-1)).max()


def test_axes_are_coloured_only_where_the_pose_may_be_believed():
    grey = np.full((220, 220, 3), 128, dtype=np.uint8)
    for channel in range(3):
        assert strongest(draw_faces(grey, [face()]), channel) > 100
        assert strongest(draw_faces(grey, [face(confidence=None)]), channel) > 100
        for unsure in (face(confidence=0.2), face(in_range=False)):
            assert strongest(draw_faces(grey, [unsure])[200:], channel) < 70
    assert (grey == 128).all()


def test_the_blue_axis_points_where_the_nose_does():
    picture = np.full((500, 500, 3), 128, dtype=np.uint8)
    for ypr, side in (((40.0, 0, 0), (-1, 0)), ((-40.0, 0, 0), (1, 0)), ((0.0, 40, 0), (0, -1))):
        drawn = draw_faces(picture, [face(size=200, ypr=ypr)]).astype(int)
        blue = np.argwhere(drawn[..., 0] - drawn[..., 1:].max(-1) > 60)[:, ::-1]
        offset = blue.mean(axis=0) - 160
        assert offset @ side > 20
        assert abs(offset @ side[::-1]) < 10


@pytest.mark.parametrize(("shape", "expected"), [((64, 96), (384, 576)), ((400, 900), (400, 900))])
def test_small_pictures_are_enlarged(shape, expected):
    drawn = draw_faces(np.zeros((*shape, 3), dtype=np.uint8), [face(20)])
    assert drawn.shape == (*expected, 3)
    assert drawn.max() > 200


def test_labels_of_neighbours_keep_clear_of_each_other():
    picture = np.zeros((600, 900, 3), dtype=np.uint8)
    faces = [face(), face(ypr=(-30.0, 10, 5), index=1)]
    faces[0].landmarks[:, :2] += 200
    faces[1].landmarks[:, :2] += [320, 190]
    apart = [(draw_faces(picture, [one], numbered=True) == 255).all(-1).sum() for one in faces]
    # White is the letters' alone; were one label on the other, some would be lost.
    together = (draw_faces(picture, faces, numbered=True) == 255).all(-1).sum()
    assert together == sum(apart)


def test_tables_of_both_kinds_hold_the_same(tmp_path):
    rows = [record("a.png", None, None, face()), record("v.mp4", 3, 0.12, face(confidence=None, index=1))]
    rows.append(record("v.mp4", 4, 0.16, None))
    for name in ("t.csv", "t.parquet"):
        with RecordWriter(tmp_path / name) as writer:
            for row in rows:
                writer.add(row)
    assert pq.read_table(tmp_path / "t.parquet").to_pylist() == rows
    with (tmp_path / "t.csv").open(newline="") as file:
        read = list(csv.DictReader(file))
    assert list(read[0]) == list(COLUMNS)
    assert [r["face"] for r in read] == ["0", "1", ""]
    assert float(read[0]["yaw_deg"]) == rows[0]["yaw_deg"] == 30.0
    assert text(rows[0]) == "a.png: yaw 30.0, pitch 10.0, roll 5.0, confidence 0.90"
    # Where there may be several faces, each has its index, the first one, too.
    assert text(rows[0], numbered=True).startswith("a.png: face 0, yaw 30.0")
    assert text(rows[1], numbered=True) == "v.mp4 0.12 s: face 1, yaw 30.0, pitch 10.0, roll 5.0"
    assert text(rows[2]) == "v.mp4 0.16 s: no face found"


def test_a_table_stopped_half_way_can_be_read(tmp_path):
    with pytest.raises(KeyboardInterrupt), RecordWriter(tmp_path / "t.parquet") as writer:
        writer.add(record("a.png", None, None, None))
        raise KeyboardInterrupt
    assert pq.read_table(tmp_path / "t.parquet").num_rows == 1


def test_tables_that_cannot_be_written(tmp_path):
    with pytest.raises(UsageError, match=r"expected a \.csv or \.parquet file"):
        RecordWriter(tmp_path / "t.xlsx")
    for name in ("t.csv", "t.parquet"):
        with pytest.raises(DataError, match="cannot be written"):
            RecordWriter(tmp_path / "nowhere" / name)
    if Path("/dev/full").exists():
        for name in ("full.csv", "full.parquet"):
            (tmp_path / name).symlink_to("/dev/full")
            full = pytest.raises(DataError, match=rf"{name}: cannot be written \(.*No space left on device")
            with full, RecordWriter(tmp_path / name) as writer:
                writer.add(record("a.png", None, None, face()))
