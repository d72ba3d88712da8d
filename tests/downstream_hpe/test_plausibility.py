# SPDX-License-Identifier: MIT
"""Upside-down heads, and what is no plausible face."""

from __future__ import annotations

import numpy as np
import pytest
from tiny_onnx import tiny_model

from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.metrics import geodesic_errors
from downstream_hpe.geometry.rotation import fit_rotation, rotation_from_angles
from downstream_hpe.prediction import detector
from downstream_hpe.prediction.detector import FaceDetector
from downstream_hpe.prediction.plausibility import DOUBTED, STEEP, FaceShapes, quarter_turns
from downstream_hpe.prediction.predictor import Predictor

QUARTERS = rotation_from_angles(np.array([[0.0, 0, 90 * k] for k in range(4)]))


def shaped():
    """The mean face as the detector finds it, at some pose."""
    return FaceShapes.load().mean[None]


def test_plausibility_does_not_depend_on_place_size_and_pose():
    model = FaceShapes.load()
    face = shaped() + 0.02 * np.random.default_rng(0).normal(size=(468, 3))
    turned = 50 * face @ rotation_from_angles(np.array([70.0, -30, 140])).T + [300, 200, 9]
    np.testing.assert_allclose(model.plausibility(turned), model.plausibility(face), atol=1e-4)
    assert model.plausibility(shaped())[0] > 0.9


def test_what_is_no_face_is_not_plausible():
    rng = np.random.default_rng(0)
    face = shaped()
    not_faces = [
        rng.normal(size=face.shape), face[:, rng.permutation(468)], face * [0.5, 1, 1], face * [1, 1, 0],
        face * [1, 1, -1], np.zeros_like(face), face + 0.1 * rng.normal(size=face.shape),
    ]  # fmt: skip
    assert FaceShapes.load().plausibility(np.concatenate(not_faces)).max() < 0.1


def test_a_model_is_less_sure_where_there_may_be_no_face(tmp_path):
    pytest.importorskip("onnxruntime")
    (tmp_path / "m.onnx").write_bytes(tiny_model().SerializeToString())
    predictor = Predictor.load(tmp_path / "m.onnx")
    garbage = np.random.default_rng(0).normal(size=(5, 468, 3))
    assert predictor.from_landmarks(garbage).confidence.max() < 1e-3
    assert predictor.from_landmarks(shaped()).confidence[0] > 0.3
    # What the graph says, times what is left of it.
    doubtful = doubtful_face()
    graph = predictor.graph(doubtful.astype(np.float32))["confidence"]
    share = FaceShapes.load().share(doubtful)
    np.testing.assert_allclose(predictor.from_landmarks(doubtful).confidence, graph * share, rtol=1e-5)
    p = FaceShapes.load().plausibility(doubtful)
    np.testing.assert_allclose(share, p**STEEP / (p**STEEP + DOUBTED**STEEP))


def test_no_pose_of_the_range_counts_as_on_its_side():
    face = upright_face()
    level = face @ fit_rotation(mean_head(), face)[0]
    ends = np.stack(np.meshgrid([-55, 0, 55], [-45, 0, 45], [-35, 0, 35]), axis=-1).reshape(-1, 3)
    assert not quarter_turns(level @ np.swapaxes(rotation_from_angles(ends), 1, 2)).any()
    assert quarter_turns(level @ rotation_from_angles(np.array([0, 0, 75.0])).T)[0] == 1


def test_faces_on_their_side_are_estimated_as_upright_ones_turned():
    pytest.importorskip("onnxruntime")
    predictor = Predictor.load()
    face = shaped() @ rotation_from_angles(np.array([20.0, 5, 10])).T
    upright = predictor.from_landmarks(face)
    every = face @ np.swapaxes(QUARTERS, 1, 2)
    first = int(quarter_turns(face)[0])
    assert quarter_turns(every).tolist() == [(first + k) % 4 for k in range(4)]
    pose = predictor.from_landmarks(every)
    assert geodesic_errors(pose.rotation, QUARTERS @ upright.rotation[0]).max() < 0.01
    np.testing.assert_allclose(rotation_from_angles(pose.ypr_deg), pose.rotation, atol=1e-5)
    np.testing.assert_allclose(pose.confidence, upright.confidence[0], atol=1e-3)
    assert predictor.in_range(pose.ypr_deg).sum() <= 1


class Answers(FaceDetector):
    """A detector whose mesh answers with these faces, in the pixels of whatever it is shown, one a call."""

    def __init__(self, *faces):
        super().__init__()
        self.answers, self.shown = iter(faces), 0

    def mesh(self, rgb, limit=1):
        self.shown += 1
        answer = next(self.answers)
        return [] if answer is None else [answer]

    def _far_faces(self, rgb):
        return []


def placed(face, quarter=0):
    """A face in the middle of 100 x 100 pixels, turned clockwise."""
    return 30 * (face @ QUARTERS[quarter].T)[0] + [50, 50, 0]


PICTURE = np.zeros((100, 100, 3), dtype=np.uint8)


def upright_face():
    """A plausible face, upright."""
    face = shaped()
    return face @ QUARTERS[-int(quarter_turns(face)[0]) % 4].T


def doubtful_face():
    face = upright_face()
    worse = face * [0.8, 1, 1]
    assert FaceShapes.load().plausibility(worse)[0] < detector.DOUBTFUL
    return worse


def test_a_plausible_face_is_looked_at_once():
    looks = Answers(placed(upright_face()))
    np.testing.assert_allclose(looks.faces(PICTURE)[0], placed(upright_face()))
    assert looks.shown == 1


def test_quarter_turns_decide_what_is_doubtful():
    bad, good = doubtful_face(), upright_face()
    # np.rot90 turns the picture counterclockwise, and an upside-down head in it with it.
    upside_down = [placed(good, (2 - k) % 4) for k in (1, 3, 2)]
    looks = Answers(placed(bad), *upside_down)
    (found,) = looks.faces(PICTURE)
    np.testing.assert_allclose(found, placed(good, 2), atol=1e-9)
    # Without the looks it is what the mesh said first; so it is if the next agrees, or they differ.
    assert np.array_equal(Answers(placed(bad)).faces(PICTURE, turned=False)[0], placed(bad))
    looks = Answers(placed(bad), placed(bad, 3))
    assert np.array_equal(looks.faces(PICTURE)[0], placed(bad)) and looks.shown == 2
    looks = Answers(placed(bad), upside_down[0], None)
    assert np.array_equal(looks.faces(PICTURE)[0], placed(bad))
    # Three that contradict and are no better: no face.
    assert not len(Answers(placed(bad), *(placed(bad, (2 - k) % 4) for k in (1, 3, 2))).faces(PICTURE))


def test_a_picture_without_a_face_is_turned():
    good = upright_face()
    wide = np.zeros((100, 140, 3), dtype=np.uint8)
    looks = Answers(None, None, None, placed(good))
    (found,) = looks.faces(wide)
    # Found in the picture turned three quarters, 100 wide and 140 high: a quarter clockwise.
    np.testing.assert_allclose(found.mean(axis=0), [50, 50, 0], atol=5)
    assert quarter_turns(found[None])[0] == 3
    assert not len(Answers(None, *[placed(doubtful_face())] * 3).faces(wide))
    assert not len(Answers(None).faces(wide, turned=False))


@pytest.mark.slow
def test_a_photograph_in_four_quarter_turns():
    """And never roll 0 for an upside-down head with any confidence."""
    pytest.importorskip("mediapipe")
    astronaut = pytest.importorskip("skimage.data").astronaut()[..., ::-1]
    predictor = Predictor.load()
    for quarter in range(4):
        pose = predictor.from_image(np.ascontiguousarray(np.rot90(astronaut, quarter)))
        if quarter == 2 and pose is None:
            continue
        turned = (pose.ypr_deg[0, 2] + 90 * quarter + 180) % 360 - 180
        assert abs(turned) < 20
        assert abs(pose.ypr_deg[0, :2]).max() < 20
    predictor.close()
