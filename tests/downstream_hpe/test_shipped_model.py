# SPDX-License-Identifier: GPL-3.0-or-later
"""The model that comes with the package: that it works on a head it has never seen, and knows when not."""

from __future__ import annotations

import numpy as np
import pytest

from downstream_hpe.geometry.metrics import euler_errors
from downstream_hpe.geometry.rotation import angles_from_rotation
from downstream_hpe.prediction.pictures import read_bgr
from downstream_hpe.prediction.predictor import MODELS, Predictor
from generator.geometry.rotation import rotation_from_angles
from generator.heads.package import save_package
from generator.heads.read import read_mesh
from generator.placing.placer import Placer
from generator.plan.settings import Lens, Look
from generator.plan.view_plan import framed_camera
from generator.plan.views import Views

pytestmark = pytest.mark.slow

pytest.importorskip("onnxruntime")

POSES = [(0, 0, 0), (40, 0, 0), (-40, 10, -10), (20, -30, 10), (-20, 30, 20), (10, 10, -25), (-45, -20, 0)]


@pytest.fixture(scope="module")
def predictor():
    return Predictor.load("headturn")


@pytest.fixture(scope="module")
def seen(placed_head, renderer, detector, tmp_path_factory):
    """Landmarks of a parametric head of another seed than the training's, and its level R_C."""
    folder = tmp_path_factory.mktemp("seen")
    mesh = read_mesh(placed_head.head, folder)
    placer = Placer(renderer, detector, folder, lambda head: mesh)
    level = placer.subject([placed_head.head], "level").placement
    package = folder / "head.npz"
    save_package(level.normalise(mesh), package)
    camera = framed_camera(Lens(resolution=256, lens_mm=60.0), level.radius_mm)
    views = Views(tuple(map(tuple, POSES)), (camera,), (Look(),))
    found = []
    for path in renderer.render(package, views):
        found.append(detector.detect(np.ascontiguousarray(read_bgr(path)[..., ::-1])))
    return np.stack(found), rotation_from_angles(np.array(POSES, dtype=float))


def test_a_head_it_has_never_seen(predictor, seen):
    landmarks, rotation = seen
    pose = predictor.from_landmarks(landmarks)
    errors = euler_errors(pose.ypr_deg, angles_from_rotation(rotation)).mean(axis=0)
    # One head: its pitch alone may be off by a few degrees.
    assert errors[0] < 4 and errors[1] < 6 and errors[2] < 4
    assert pose.confidence.min() > 0.2


def test_it_is_not_sure_of_what_is_no_face(predictor, seen):
    landmarks, _ = seen
    rng = np.random.default_rng(0)
    centred = landmarks - landmarks.mean(axis=1, keepdims=True)
    garbage = {
        "noise": rng.normal(size=landmarks.shape),
        "scrambled": landmarks[:, rng.permutation(468)],
        "inside out": centred * [1, 1, -1],
        "flat": centred * [1, 1, 0],
    }
    for name, points in garbage.items():
        assert predictor.from_landmarks(points).confidence.mean() < 0.15, name


def test_it_is_less_sure_beyond_its_range(predictor, seen):
    landmarks, rotation = seen
    level = (landmarks - landmarks.mean(axis=1, keepdims=True)) @ rotation
    means = []
    for yaw in (0.0, 70.0, 90.0):
        there = rotation_from_angles(np.array([yaw, 0.0, 0.0]))
        means.append(predictor.from_landmarks(level @ there.T).confidence.mean())
    assert means[0] > 0.4 and means[1] < 0.6 * means[0] and means[2] < 0.05


def test_a_photograph(predictor):
    pytest.importorskip("mediapipe")
    data = pytest.importorskip("skimage.data")
    pose = predictor.from_image(data.astronaut()[..., ::-1])
    yaw, pitch, roll = pose.ypr_deg[0]
    # She looks at the camera, her head turned a little to image left and leaning the same way.
    assert -5 < yaw < 20 and abs(pitch) < 15 and abs(roll) < 15
    # Her smile is one that few renders have.
    assert pose.confidence[0] > 0.25


def test_it_is_small_and_says_where_it_comes_from(predictor):
    assert (MODELS / "headturn.onnx").stat().st_size < 3e6
    np.testing.assert_array_equal(predictor.range_deg, [[-50, 50], [-40, 40], [-30, 30]])
    assert len(predictor.trained_subjects) >= 100
    card = (MODELS / "headturn.md").read_text(encoding="utf-8")
    assert "{" not in card.replace("```", "")
