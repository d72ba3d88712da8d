# SPDX-License-Identifier: MIT
"""Where heads are, on faces made by the tables' own geometry: K (R_C X + t)."""

from __future__ import annotations

import json

import numpy as np
import pytest
from tiny_onnx import tiny_model

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.geometry.camera import Camera, aimed_at, fit_translation, seen_towards
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.metrics import geodesic_errors
from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.prediction.cameras import camera_file, chosen_camera, guessed_camera
from downstream_hpe.prediction.predictor import Predictor
from downstream_hpe.prediction.six_degrees import place, undone

CAMERA = Camera(np.array([[900.0, 2, 500], [0, 950, 380], [0, 0, 1]]))
PLACES_MM = np.array([[0.0, 0, 500], [-300, 150, 800], [900, -700, 2000], [0, 0, 5000]])
YPR_DEG = np.array([[0.0, 0, 0], [35, -20, 10], [-50, 30, -25], [10, 10, 5]])


def spread(points):
    return np.linalg.norm(points.std(axis=1), axis=-1)


def seen(camera, rotation, translation_mm):
    """Landmarks as a detector gives them: pixels, and depth along the line of sight in their scale."""
    points = mean_head() @ np.swapaxes(rotation, -1, -2) + translation_mm[:, None]
    pixels, sight = camera.pixels(points), points @ aimed_at(translation_mm)
    depth = sight[..., 2:] - np.linalg.norm(translation_mm, axis=1)[:, None, None]
    pixels_per_mm = spread(pixels) / spread(sight[..., :2])
    return np.concatenate([pixels, depth * pixels_per_mm[:, None, None]], axis=-1)


def test_translation_is_exact_where_the_head_and_its_rotation_are():
    rotation = rotation_from_angles(YPR_DEG)
    pixels = seen(CAMERA, rotation, PLACES_MM)[..., :2]
    np.testing.assert_allclose(fit_translation(mean_head(), rotation, pixels, CAMERA), PLACES_MM, atol=1e-6)
    # A head that is a tenth larger is a tenth farther away.
    np.testing.assert_allclose(
        fit_translation(1.1 * mean_head(), rotation, pixels, CAMERA), 1.1 * PLACES_MM, atol=1e-6
    )
    # As it is with the picture of a camera of twice the focal length.
    twice = Camera(np.diag([2.0, 2, 1]) @ CAMERA.matrix)
    np.testing.assert_allclose(
        fit_translation(mean_head(), rotation, 2 * pixels, twice), PLACES_MM, atol=1e-6
    )


def test_both_angles_of_a_face_away_from_the_axis():
    rotation = rotation_from_angles(YPR_DEG)
    aim = aimed_at(PLACES_MM)
    np.testing.assert_allclose(
        aim @ np.swapaxes(aim, 1, 2), np.broadcast_to(np.eye(3), (4, 3, 3)), atol=1e-12
    )
    np.testing.assert_allclose(aim[..., 2], PLACES_MM / np.linalg.norm(PLACES_MM, axis=1)[:, None])
    towards = np.swapaxes(aim, 1, 2) @ rotation
    along_axis, translation_mm = place(seen(CAMERA, rotation, PLACES_MM), towards, CAMERA)
    np.testing.assert_allclose(along_axis, rotation, atol=1e-5)
    np.testing.assert_allclose(translation_mm, PLACES_MM, atol=0.01)
    # On the axis, as in the tables, they are the same.
    assert (
        geodesic_errors(towards, rotation)[[0, 3]].max() < 1e-6 < 20 < geodesic_errors(towards, rotation)[1]
    )


def test_perspective_is_undone_to_what_a_camera_turned_to_the_head_sees():
    rotation = rotation_from_angles(YPR_DEG)
    landmarks, aim = seen(CAMERA, rotation, PLACES_MM), aimed_at(PLACES_MM)
    towards = np.swapaxes(aim, 1, 2) @ rotation
    ahead = np.array([[0, 0, distance] for distance in np.linalg.norm(PLACES_MM, axis=1)])
    expected = seen(CAMERA, towards, ahead)
    np.testing.assert_allclose(seen_towards(landmarks, CAMERA, aim)[..., :2], expected[..., :2], atol=1e-6)
    # Also where the place is only found with a rotation that is a few degrees off; one without stays.
    landmarks[3] = -landmarks[3]
    off = towards @ rotation_from_angles(np.array([4.0, -3, 2]))
    found = undone(landmarks, off, CAMERA)
    assert np.abs(normalise(found[:3]) - normalise(expected[:3])).max() < 0.02
    assert np.abs(normalise(landmarks[:3]) - normalise(expected[:3])).max() > 0.1
    np.testing.assert_array_equal(found[3], landmarks[3])


def test_the_same_face_at_the_middle_and_at_the_edge():
    pytest.importorskip("onnxruntime")
    predictor = Predictor.load()
    camera = Camera.from_fov(80, 1000, 700)
    towards = rotation_from_angles(np.array([[15.0, 5, -10]] * 2))
    places_mm = 1500 * np.array([[0, 0, 1], [0.48, 0.24, np.sqrt(1 - 0.48**2 - 0.24**2)]])
    landmarks = seen(camera, aimed_at(places_mm) @ towards, places_mm)
    pose = predictor.from_landmarks(landmarks, camera)
    raw = predictor.from_landmarks(landmarks).rotation
    assert geodesic_errors(*pose.rotation) < 0.5 < 2 < geodesic_errors(*raw)
    assert 25 < geodesic_errors(pose.axis_rotation[1], pose.rotation[1]) < 40
    middle, edge = pose.translation_mm
    assert np.linalg.norm(edge) == pytest.approx(np.linalg.norm(middle), rel=0.01)
    assert np.abs(edge / np.linalg.norm(edge) - places_mm[1] / 1500).max() < 0.02
    np.testing.assert_allclose(rotation_from_angles(pose.axis_ypr_deg), pose.axis_rotation, atol=1e-6)
    # A guess places the head, and leaves what the model says alone.
    guessed = predictor.from_landmarks(landmarks, guessed_camera(1000, 700))
    np.testing.assert_array_equal(guessed.ypr_deg, predictor.from_landmarks(landmarks).ypr_deg)
    assert np.linalg.norm(guessed.translation_mm[0]) > 1.2 * np.linalg.norm(middle)


def test_no_face_and_no_camera(tmp_path):
    pytest.importorskip("onnxruntime")
    (tmp_path / "m.onnx").write_bytes(tiny_model().SerializeToString())
    predictor = Predictor.load(tmp_path / "m.onnx")
    assert predictor.from_landmarks(np.ones((0, 468, 3)), CAMERA).translation_mm.shape == (0, 3)
    assert predictor.from_landmarks(mean_head()[None]).translation_mm is None


def write(path, facts):
    path.write_text(facts if isinstance(facts, str) else json.dumps(facts))
    return path


def test_cameras_of_the_command_line(tmp_path):
    matrix = CAMERA.matrix.tolist()
    plain = camera_file(write(tmp_path / "k.json", {"K": matrix}))
    np.testing.assert_array_equal(plain(640, 480).matrix, CAMERA.matrix)
    sized = camera_file(write(tmp_path / "k.json", {"K": matrix, "width": 1000, "height": 750}))
    np.testing.assert_allclose(sized(500, 375).matrix[:2], CAMERA.matrix[:2] / 2)
    with pytest.raises(DataError, match=r"500 x 500 pixels, and .*k\.json is for 1000 x 750"):
        sized(500, 500)
    for width, height in ((800, 600), (600, 800)):
        of_fov = chosen_camera(90, None)(width, height)
        assert of_fov.focal_px == pytest.approx(400) and not of_fov.guessed
        np.testing.assert_array_equal(of_fov.matrix[:2, 2], [width / 2, height / 2])
    assert chosen_camera(None, None) is guessed_camera and guessed_camera(8, 8).guessed
    with pytest.raises(UsageError, match="give one"):
        chosen_camera(60, tmp_path / "k.json")


@pytest.mark.parametrize(
    "facts",
    [
        "", "[]", "[" * 100_000, {"K": 5}, {"K": [[1, 0, 0], [0, 1, 0]]}, {"K": [["a"] * 3] * 3},
        {"K": [[0, 0, 1], [0, 1, 1], [0, 0, 1]]}, {"K": [[1, 0, 1], [0, 1, 1], [0, 0, 2]]},
        '{"K": [[1e999, 0, 1], [0, 1, 1], [0, 0, 1]]}',
        {"K": [[1, 0, 1], [0, 1, 1], [0, 0, 1]], "width": 5},
        {"K": [[10**400, 0, 1], [0, 1, 1], [0, 0, 1]]},
        {"K": [[1, 0, 1], [0, 1, 1], [0, 0, 1]], "width": 0, "height": 4},
    ],
)  # fmt: skip
def test_files_that_are_no_camera(tmp_path, facts):
    with pytest.raises(DataError, match=r'k\.json: .*expected \{"K"') as caught:
        camera_file(write(tmp_path / "k.json", facts))
    assert "\n" not in str(caught.value)


def test_a_partial_face_is_where_the_whole_one_is():
    """The shipped model and a camera; points right of the middle are not seen, chin or forehead with them."""
    model = Predictor.load()
    rotation = rotation_from_angles(YPR_DEG)
    whole = seen(CAMERA, rotation, PLACES_MM)
    middle = np.median(whole[..., :1], axis=1, keepdims=True)
    half = np.where(whole[..., :1] > middle, np.nan, whole)
    expected, found = (model.from_landmarks(points, CAMERA) for points in (whole, half))
    assert np.isfinite(found.translation_mm).all()
    assert geodesic_errors(found.axis_rotation, expected.axis_rotation).max() < 10
    off = np.linalg.norm(found.translation_mm - expected.translation_mm, axis=1)
    assert (off < 0.08 * np.linalg.norm(PLACES_MM, axis=1)).all()
