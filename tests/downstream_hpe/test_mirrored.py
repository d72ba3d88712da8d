# SPDX-License-Identifier: MIT
"""scripts/mirrored.py: what is mirrored and turned is followed, and a wrong sign is not."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from PIL import Image

from downstream_hpe.evaluation.estimators import rigid_fit
from downstream_hpe.geometry.face_mesh import mirror_pairs
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.prediction.predictor import Pose
from scripts import mirrored

pytest.importorskip("onnxruntime")


class Estimator:
    """A rigid fit whose angles are multiplied by signs [3]."""

    def __init__(self, face, signs):
        self._fit, self._signs = rigid_fit(face), np.asarray(signs)

    def from_landmarks(self, landmarks):
        ypr_deg = self._fit(landmarks) * self._signs
        return Pose(ypr_deg, rotation_from_angles(ypr_deg))


@pytest.fixture
def symmetric():
    """The mean head's face, the same on both sides."""
    face = mean_head()
    return (face + face[mirror_pairs()] * [-1, 1, 1]) / 2


def exact_looks(face):
    """Faces at a pose, and what a detector without errors finds in the changed pictures."""
    before = face @ rotation_from_angles(np.array([25.0, -12, 8])).T
    for change in mirrored.CHANGES:
        points = before[mirror_pairs()] * [-1, 1, 1]
        turn = rotation_from_angles(np.array([0, 0, change.turn_deg]))
        yield mirrored.Look(change, before, points if change.mirrored else before @ turn.T)


def test_an_estimator_that_follows_has_nothing_left(symmetric):
    lines, worst = mirrored.report(list(exact_looks(symmetric)), Estimator(symmetric, [1, 1, 1]), symmetric)
    assert worst == pytest.approx(0, abs=1e-6)
    assert [line.split(" | ")[1] for line in lines[2:]] == ["1", "2", "2", "2", "2", "8"]
    assert lines[2].startswith("| mirrored | 1 | 0 | 0.00 | 0.00 / 0.00 / 0.00 | 0.00 | 0.00 |")


@pytest.mark.parametrize("signs", [[-1, 1, 1], [1, -1, 1], [1, 1, -1]])
def test_a_wrong_sign_is_beyond_the_limit(symmetric, signs):
    lines, worst = mirrored.report(list(exact_looks(symmetric)), Estimator(symmetric, signs), symmetric)
    assert worst > mirrored.LIMIT_DEG
    # The rigid fit beside it has its signs.
    assert lines[-1].endswith("| 0.00 | 0.00 / 0.00 / 0.00 | 0.00 |")


def test_a_face_that_is_not_found_again_is_counted(symmetric):
    every = list(exact_looks(symmetric))
    every[0] = mirrored.Look(every[0].change, every[0].before, None)
    lines, worst = mirrored.report(every, Estimator(symmetric, [1, 1, 1]), symmetric)
    assert lines[2].startswith("| mirrored | 1 | 1 | nan")
    assert lines[-1].startswith("| turned | 8 | 0 | 0.00")
    assert worst == pytest.approx(0, abs=1e-6)


def run(*arguments, monkeypatch):
    """Exit code of the script."""
    monkeypatch.setattr(sys, "argv", ["mirrored.py", *map(str, arguments)])
    try:
        mirrored.main()
    except SystemExit as stopped:
        return stopped.code
    return 0


@pytest.mark.slow
def test_a_photograph(monkeypatch, capsys):
    pytest.importorskip("mediapipe")
    pytest.importorskip("skimage.data")
    names = mirrored.carried()
    assert run(*names, "--limit", 2, monkeypatch=monkeypatch) == 0
    said = capsys.readouterr().out
    assert f"{len(names)} faces of {len(names)} pictures" in said
    # The same with what is expected turned the other way round, or not mirrored.
    with monkeypatch.context() as patched:
        patched.setattr(mirrored, "MIRROR", np.eye(3))
        assert run(*names, "--limit", 2, monkeypatch=patched) == 1
    with monkeypatch.context() as patched:
        patched.setattr(mirrored.Change, "rotation", lambda self, r: rotation_from_angles([0, 0, -30.0]) @ r)
        assert run(*names, "--limit", 2, monkeypatch=patched) == 1
    assert "degrees on average, expected at most 2" in capsys.readouterr().err


@pytest.mark.slow
def test_bad_input_is_one_line(tmp_path, monkeypatch, capsys):
    pytest.importorskip("mediapipe")
    Image.new("RGB", (64, 64)).save(tmp_path / "black.png")
    for given, expected in (
        (tmp_path / "black.png", "no face was found"),
        (tmp_path / "none.png", "no such"),
    ):
        assert run(given, monkeypatch=monkeypatch) in (1, 2)
        error = capsys.readouterr().err
        assert expected in error
        assert error.count("\n") == 1
