# SPDX-License-Identifier: MIT
"""Heads on their side and upside down in videos."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.prediction.detector import DOUBTFUL
from downstream_hpe.prediction.pictures import read_bgr
from downstream_hpe.prediction.plausibility import FaceShapes, quarter_turns
from downstream_hpe.prediction.predictor import Predictor
from downstream_hpe.prediction.way_up import PATIENCE_S, WayUp
from scripts.mirrored import carried

FRAME = np.zeros((100, 140, 3), dtype=np.uint8)
NONE = np.empty((0, 468, 3))


def face(quarter=0):
    """A plausible face in the middle of the frame, turned clockwise."""
    shape = FaceShapes.load().mean[None]
    back = quarter - int(quarter_turns(shape)[0])
    turned = shape @ rotation_from_angles(np.array([0.0, 0, 90 * back])).T
    return 30 * turned + [70, 50, 0]


class Sees:
    """Stands for a predictor: finds these faces, one answer a call. calls: what it was shown, and how."""

    def __init__(self, *answers):
        self._answers, self.calls = iter(answers), []

    def faces(self, bgr, limit, turned):
        self.calls.append((bgr.shape[:2], turned))
        return next(self._answers)


def test_a_plausible_face_takes_one_look():
    way, sees = WayUp(), Sees(face(), face())
    for time_s in (0.0, 5.0):
        assert np.array_equal(way.faces(sees, FRAME, 1, time_s), face())
    assert sees.calls == [((100, 140), False)] * 2


@pytest.mark.parametrize("quarter", [1, 2, 3])
def test_the_next_frames_are_turned_as_the_first_was(quarter):
    # The frame turned upright shows the face upright, wherever its middle is then.
    upright = face() + ([-20, 20, 0] if quarter % 2 else [0, 0, 0])
    way, sees = WayUp(), Sees(NONE, face(quarter), upright)
    assert np.array_equal(way.faces(sees, FRAME, 1, 0.0), face(quarter))
    found = way.faces(sees, FRAME, 1, 0.04)
    np.testing.assert_allclose(found, face(quarter), atol=1e-9)
    shape = (140, 100) if quarter % 2 else (100, 140)
    assert sees.calls == [((100, 140), False), ((100, 140), True), (shape, False)]


def test_what_is_doubtful_is_tried_again_only_after_a_while():
    doubtful = 0.8 * (face() - 50) * [0.8, 1, 1] + 50
    assert FaceShapes.load().plausibility(doubtful)[0] < DOUBTFUL
    way, sees = WayUp(), Sees(*[doubtful] * 3, NONE, doubtful, face(2))
    # All ways up say the same, or nothing better: it stays.
    assert np.array_equal(way.faces(sees, FRAME, 1, 0.0), doubtful)
    assert np.array_equal(way.faces(sees, FRAME, 1, PATIENCE_S / 2), doubtful)
    assert [turned for _, turned in sees.calls] == [False, True, False]
    assert not len(way.faces(Sees(NONE), FRAME, 1, PATIENCE_S / 2))
    way.faces(Sees(NONE, NONE), FRAME, 1, PATIENCE_S)
    assert way.quarter == 0
    way.faces(Sees(NONE, face(2)), FRAME, 1, 2 * PATIENCE_S)
    assert way.quarter == 2
    # And back: at once.
    way.faces(Sees(NONE, face()), FRAME, 1, 3 * PATIENCE_S)
    assert way.quarter == 0


@pytest.mark.slow
def test_a_photograph_upside_down_as_a_video():
    pytest.importorskip("mediapipe")
    pytest.importorskip("onnxruntime")
    [file] = [name for name in carried() if "hopper" in name] or pytest.skip("no such portrait here")
    portrait = read_bgr(Path(file))
    predictor, way = Predictor.load(), WayUp()
    (upright,) = predictor.faces(portrait)
    upside_down = np.ascontiguousarray(portrait[::-1, ::-1])
    frames = [way.faces(predictor, upside_down, 1, n / 25) for n in range(3)]
    assert way.quarter == 2
    size = [portrait.shape[1], portrait.shape[0]]
    for found in frames:
        np.testing.assert_allclose(found[0, :, :2], size - upright[:, :2], atol=8)
    roll = predictor.from_landmarks(frames[-1]).ypr_deg[0, 2]
    assert abs(abs(roll) - 180) < 20
    predictor.close()
