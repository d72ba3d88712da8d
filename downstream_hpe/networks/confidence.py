# SPDX-License-Identifier: MIT
"""How sure an estimate is: the calibrated probability that its geodesic error is below 5 degrees.

Landmarks turned back by the estimate should be a level face. How they are not is put into four numbers,
and where the estimate lies into two an angle; a logistic function of them is fitted to faces that were
held out. No weight may be positive, and each has a floor, so that whatever was never seen, a pose beyond
the range or no face at all, makes the estimate less sure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from downstream_hpe.errors import ModelError
from downstream_hpe.geometry.face_mesh import FEATURES, POINTS
from downstream_hpe.geometry.metrics import SURE_DEG, geodesic_errors
from downstream_hpe.geometry.normalise import Normalisation, normalise

COMPONENTS = 24
"""Directions in which level faces differ, the pose's own distortions among them."""
TURNS = 3
QUANTITIES = ("outside", "shape", "turn", "yaw", "pitch", "roll", "beyond yaw", "beyond pitch", "beyond roll")
FLOORS = np.array([0.5, 0.5, 0.3, 0.0, 0.0, 0.0, 8.0, 8.0, 8.0])
"""Least weights: about half a unit of the logit for a typical residual, 8 for BEYOND_DEG beyond the range."""
BEYOND_DEG = 20.0
PRIOR = 1e-3
_SAMPLE = 4000
_LEAST_SCALE = 0.05
"""Of a sum of squares over the face: points 1 % of its radius off, which any detector is."""


@dataclass(frozen=True)
class Confidence:
    """What turns an estimate into a probability.

    mean float64 [1404]: the mean level face. basis float64 [1404, 3 + K]: orthonormal; turns of that
    face about the three axes, then components of shape. scale float64 [3 + K + 1]: what the squares
    of the coefficients, and of what the basis leaves, are divided by. range_deg float64 [3, 2].
    weights float64 [9] of QUANTITIES, bias.
    """

    mean: np.ndarray
    basis: np.ndarray
    scale: np.ndarray
    range_deg: np.ndarray
    weights: np.ndarray
    bias: float

    def of(self, features: np.ndarray, ypr_deg: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Probability that the geodesic error is below SURE_DEG, float64 [N].

        features: float [N, 1404], normalised landmarks. ypr_deg [N, 3], rotation [N, 3, 3]: the estimate.
        """
        logit = self.bias - self.quantities(features, ypr_deg, rotation) @ self.weights
        return expit(logit)

    def quantities(self, features: np.ndarray, ypr_deg: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """float64 [N, 9], none negative; about 1 for a face like those trained on, at the range's edge, or
        BEYOND_DEG beyond it."""
        level = np.asarray(features, dtype=np.float64).reshape(-1, POINTS, 3) @ rotation
        residual = level.reshape(len(level), -1) - self.mean
        parts = np.square(residual @ self.basis)
        rest = np.maximum(np.square(residual).sum(axis=1) - parts.sum(axis=1), 0) / self.scale[-1]
        scaled = parts / self.scale[:-1]
        turn, shape = scaled[:, :TURNS].sum(axis=1), scaled[:, TURNS:].sum(axis=1)
        middle, half = self.range_deg.mean(axis=1), np.ptp(self.range_deg, axis=1) / 2
        place = np.abs(ypr_deg - middle)
        beyond = np.maximum(place - half, 0) / BEYOND_DEG
        inside = np.minimum(place, half) / half
        return np.column_stack([*np.sqrt([rest, shape, turn]), np.square(inside), np.square(beyond)])


def level_faces(
    landmarks: np.ndarray, rotation: np.ndarray, normalisation: Normalisation
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean, basis and scale of :class:`Confidence`, from training faces and their true R_C."""
    chosen = slice(None, None, -(-len(landmarks) // _SAMPLE))
    level = normalise(landmarks[chosen].astype(np.float64), normalisation) @ rotation[chosen]
    mean = level.mean(axis=0)
    turns = np.stack([np.cross(axis, mean).reshape(-1) for axis in np.eye(3)], axis=1)
    turns, _ = np.linalg.qr(turns)
    residual = (level - mean).reshape(len(level), FEATURES)
    coefficients = residual @ turns
    _, values, components = np.linalg.svd(residual - coefficients @ turns.T, full_matrices=False)
    kept = min(COMPONENTS, len(level) // 2)
    variance = np.square(values) / len(level)
    # Each of the three sums of squares has mean 1 over the training faces.
    turn = np.full(TURNS, np.square(coefficients).sum(axis=1).mean())
    scale = np.concatenate([turn, variance[:kept] * kept, [variance[kept:].sum()]])
    basis = np.concatenate([turns, components[:kept].T], axis=1)
    return mean.reshape(-1), basis, np.maximum(scale, _LEAST_SCALE)


def calibrate(
    faces: tuple[np.ndarray, np.ndarray, np.ndarray],
    range_deg: np.ndarray,
    features: np.ndarray,
    ypr_deg: np.ndarray,
    rotation: np.ndarray,
    true: np.ndarray,
) -> Confidence:
    """Fit the logistic function to estimates of faces that were held out.

    Parameters
    ----------
    faces: of :func:`level_faces`. features: float [N, 1404]. ypr_deg [N, 3] and rotation [N, 3, 3]:
    estimates; true [N, 3, 3]: R_C.

    Raises
    ------
    ModelError: an estimate is not finite.
    """
    if not np.isfinite(ypr_deg).all():
        raise ModelError("an estimate of a held-out face is not finite; train again with another seed")
    blank = Confidence(*faces, np.asarray(range_deg, dtype=np.float64), np.zeros(len(QUANTITIES)), 0.0)
    given = blank.quantities(features, ypr_deg, rotation)
    sure = geodesic_errors(rotation, true) < SURE_DEG

    def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        bias, weights = parameters[0], parameters[1:]
        logit = bias - given @ weights
        chance = expit(logit)
        value = np.mean(np.logaddexp(0, logit) - sure * logit) + PRIOR * np.square(parameters).sum()
        slope = chance - sure
        gradient = np.concatenate([[slope.mean()], -(slope[:, None] * given).mean(axis=0)])
        return float(value), gradient + 2 * PRIOR * parameters

    start = np.concatenate([[2.0], FLOORS])
    bounds = [(None, None), *((floor, None) for floor in FLOORS)]
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x
    return Confidence(*faces, blank.range_deg, found[1:], float(found[0]))
