# SPDX-License-Identifier: MIT
from __future__ import annotations

import numpy as np
import pytest

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.metrics import geodesic_errors
from downstream_hpe.predicting import predictions, sources
from downstream_hpe.predictor import Pose
from downstream_hpe.rotation import rotation_from_angles
from downstream_hpe.smoothing import OneEuroFilter


def test_smoothing_calms_a_still_head_and_follows_a_turn():
    rng = np.random.default_rng(0)
    true = np.zeros((120, 3))
    true[60:80, 0] = np.linspace(0, 40, 20)
    true[80:, 0] = 40
    exact = rotation_from_angles(true)
    noisy = rotation_from_angles(true + rng.normal(scale=1.0, size=true.shape))
    filtered = OneEuroFilter()
    smooth = np.stack([filtered(rotation, n / 30) for n, rotation in enumerate(noisy)])
    np.testing.assert_allclose(smooth @ smooth.transpose(0, 2, 1), np.eye(3)[None].repeat(120, 0), atol=1e-9)
    still = slice(20, 60)
    assert geodesic_errors(smooth, exact)[still].mean() < 0.7 * geodesic_errors(noisy, exact)[still].mean()
    assert geodesic_errors(smooth, exact)[60:90].max() < 10
    with pytest.raises(ValueError, match="times must rise"):
        filtered(noisy[0], 0.0)


class Brightness:
    """Stands for a predictor: a face in every frame that is not black."""

    def landmarks(self, bgr):
        return None if bgr.max() < 40 else np.random.default_rng(0).uniform(10, 50, size=(468, 3))

    def from_landmarks(self, landmarks):
        return Pose(np.array([[20.0, 10, 5]]), rotation_from_angles(np.array([[20.0, 10, 5]])))


@pytest.fixture
def video(tmp_path):
    pytest.importorskip("cv2")
    from downstream_hpe.video import VideoWriter

    with VideoWriter(tmp_path / "clip.mp4", 25.0) as writer:
        for n in range(12):
            writer.add(np.full((64, 64, 3), 0 if n == 5 else 200, dtype=np.uint8))
    return tmp_path / "clip.mp4"


def test_every_frame_of_a_video_has_a_record(video, tmp_path):
    every = sources([str(video)])
    records = list(predictions(every, Brightness(), tmp_path / "drawn", smooth=True))
    assert [r["frame"] for r in records] == list(range(12))
    assert [r["found"] for r in records] == [n != 5 for n in range(12)]
    assert (records[6]["yaw_deg"], records[5]["yaw_deg"]) == (20.0, None)
    assert records[3]["time_s"] == pytest.approx(3 / 25)
    assert len(list(predictions(sources([str(tmp_path / "drawn")]), Brightness()))) == 12
    assert len(list(predictions(every, Brightness(), frames=4))) == 4


def test_a_video_cut_off_and_one_that_is_none(video, tmp_path):
    (tmp_path / "cut.mp4").write_bytes(video.read_bytes()[:200])
    (tmp_path / "none.mp4").write_bytes(b"no video")
    for name in ("cut.mp4", "none.mp4"):
        with pytest.raises(DataError, match=f"{name}: cannot be opened as video"):
            list(predictions([tmp_path / name], Brightness()))


def test_inputs_that_are_none(tmp_path):
    assert sources(["webcam:2"]) == [2]
    with pytest.raises(UsageError, match="expected a number"):
        sources(["webcam:front"])
    with pytest.raises(UsageError, match="no picture or video in it"):
        sources([str(tmp_path)])
