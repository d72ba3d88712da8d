# SPDX-License-Identifier: MIT
"""Whether landmarks are those of a face: in the middle of it, upright, and its lower half to be seen.

A detector that looks at an upside-down head, a mask or a hand answers with a face as well. Turned level by
a rigid fit, it is not quite one of those that it finds in plain pictures: it differs in what the linear model
of their shapes spans, and more in what that leaves. A logistic function of both says how plausible it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from downstream_hpe.geometry.face_mesh import CHIN, FOREHEAD
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.partial import completed

FACE_SHAPES = Path(__file__).parents[1] / "models" / "face_shapes.npz"
"""Made by scripts/make_face_shapes.py, which prints what its numbers are worth."""
UPRIGHT_DEG = 60.0
DOUBTED, STEEP = 0.2, 3
"""Plausibility, which was fitted to extremes, that halves a confidence, and the power with which it does:
faces of photographs that come to less are placed badly, those above as well as any."""
SOME = slice(None, None, 3)
"""The landmarks that are looked at: a third says as much."""
LEAST_LEFT, LEAST_SIZE = 1e-9, 1e-9
"""Of the squares that the basis leaves, and of a face: less is rounding."""


@dataclass(frozen=True)
class FaceShapes:
    """mean [468, 3]: the mean face at some pose, frame C; its P points SOME are centred and have RMS 1. basis
    [K, 3 P]: orthonormal directions in which those differ, once turned to it. weights [K + 1], of the
    coordinates along them and of the logarithm of the size of what they leave; bias."""

    mean: np.ndarray
    basis: np.ndarray
    weights: np.ndarray
    bias: float

    @staticmethod
    @cache
    def load() -> FaceShapes:
        """Those that come with the package, float32."""
        with np.load(FACE_SHAPES) as file:
            return FaceShapes(file["mean"], file["basis"], file["weights"], float(file["bias"]))

    def quantities(self, landmarks: np.ndarray) -> np.ndarray:
        """What the logistic function is of, [N, K + 1]. landmarks: float [N, 468, 3], any unit, frame C, NaN
        where a point is not seen.

        As ``normalise`` and ``fit_rotation``, in fewer and smaller steps: a single face is quick.
        """
        mean, face = self.mean[SOME], landmarks[:, SOME]
        if np.isnan(face).any():
            face = completed(face, mean)
        face = face - np.einsum("npi->ni", face)[:, None] / face.shape[1]
        size = np.sqrt(np.einsum("npi,npi->n", face, face) / face.shape[1])
        cross = np.swapaxes(face, 1, 2) @ mean
        u, _, vt = np.linalg.svd(cross)
        u[:, :, 2] *= np.sign(np.linalg.det(cross))[:, None]
        level = face @ (u @ vt) / np.maximum(size, LEAST_SIZE)[:, None, None]
        residual = (level - mean).reshape(len(face), mean.size)
        # No matrix product: for one face its threads cost more than they save.
        along = np.einsum("nj,kj->nk", residual, self.basis)
        left = np.einsum("nj,nj->n", residual, residual) - np.einsum("nk,nk->n", along, along)
        return np.concatenate([along, 0.5 * np.log(np.maximum(left, LEAST_LEFT))[:, None]], axis=1)

    def plausibility(self, landmarks: np.ndarray) -> np.ndarray:
        """0 to 1, [N]. Arguments as :meth:`quantities`."""
        # The logistic function; scipy's takes longer to import than all the rest.
        return np.exp(-np.logaddexp(0, self.quantities(landmarks) @ self.weights - self.bias))

    def share(self, landmarks: np.ndarray) -> np.ndarray:
        """What is left of a confidence where faces are doubtful: 0 to 1, [N]. Arguments as above.

        p^3 / (p^3 + 0.2^3) of plausibility p: doubtful faces of photographs are placed well down to that.
        """
        return 1 / (1 + (DOUBTED / np.maximum(self.plausibility(landmarks), LEAST_SIZE)) ** STEEP)


def quarter_turns(landmarks: np.ndarray) -> np.ndarray:
    """By how many quarter turns, clockwise in the picture, faces are from upright: int [N], 0 to 3.

    0 up to UPRIGHT_DEG, which forehead and chin stay within at any pose that is trained on; else the nearest.
    landmarks: float [N, 468, 3], frame C, NaN where a point is not seen.
    """
    if np.isnan(landmarks[:, [CHIN, FOREHEAD]]).any():
        landmarks = completed(landmarks, mean_head())
    down = landmarks[:, CHIN] - landmarks[:, FOREHEAD]
    lean_deg = np.rad2deg(np.arctan2(-down[:, 0], down[:, 1]))
    return np.where(np.abs(lean_deg) < UPRIGHT_DEG, 0, np.rint(lean_deg / 90).astype(int) % 4)
