# SPDX-License-Identifier: MIT
"""How sure an estimate is: the calibrated probability that its geodesic error is below 5 degrees.

The squared error to be expected is a sum of parts, none negative. Landmarks turned back by the estimate
should be a level face: how far they are from it is put into three numbers, and where the estimate lies into
two an angle. Their weights are fitted to faces that were not trained on; each has a floor, so that whatever
was never seen, a pose beyond the range, no face at all or half of one, makes the estimate less sure.

Two angles that are off by normal errors of mean square V in all are off by less than t with the probability
1 - exp(-t^2 / V), Rayleigh's distribution; of three, the one that is found best, roll, counts little.

That is for landmarks that are of a face; :mod:`downstream_hpe.prediction.plausibility` says how far they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from downstream_hpe.errors import ModelError
from downstream_hpe.geometry.face_mesh import FEATURES, POINTS
from downstream_hpe.geometry.metrics import SURE_DEG, geodesic_errors
from downstream_hpe.geometry.normalise import Normalisation, normalise
from downstream_hpe.geometry.partial import among, seen_points

COMPONENTS = 24
"""Directions in which level faces differ, the pose's own distortions among them."""
TURNS = 3
QUANTITIES = (
    *("outside", "shape", "turn"),
    *("strange outside", "strange shape", "strange turn"),
    *("yaw", "pitch", "roll"),
    *("beyond yaw", "beyond pitch", "beyond roll"),
    "unseen",
)
UNITS = np.array([25.0] * 9 + [400.0] * 3 + [100.0])
"""What weights are measured in, square degrees: an error of SURE_DEG for a face like those trained on and at
the range's edge, of BEYOND_DEG so far beyond it, and of 10 of a face of which next to nothing is seen."""
FLOORS = np.array([0.04, 0.04, 0.04, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]) * UNITS
"""Least weights: what is strange is off, beyond the range by as much as it is beyond, and a partial face, of
which those that it is calibrated on have none, by as much as is not seen."""
STRANGE = 2.5
"""Residuals above so many times those of the training faces are of no face, or of another's pose."""
LEAST = 1.0
"""Square degrees that even the plainest face leaves open."""
BEYOND_DEG = 20.0
PRIOR = 1e-3
"""On the squares of what weights, in UNITS, have above their floors: a few rows decide nothing."""
_SAMPLE = 4000
_LEAST_CHANCE = 1e-9
_LEAST_SCALE = 0.05
"""Of a sum of squares over the face: points 1 % of its radius off, which any detector is."""


@dataclass(frozen=True)
class Confidence:
    """What turns an estimate into a probability.

    mean float64 [1404]: the mean level face. basis float64 [1404, 3 + K]: orthonormal; turns of that
    face about the three axes, then components of shape. scale float64 [3 + K + 1]: what the squares
    of the coefficients, and of what the basis leaves, are divided by. range_deg float64 [3, 2].
    weights float64 [13] of QUANTITIES and bias: square degrees.
    """

    mean: np.ndarray
    basis: np.ndarray
    scale: np.ndarray
    range_deg: np.ndarray
    weights: np.ndarray
    bias: float

    def of(self, features: np.ndarray, ypr_deg: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """Probability that the geodesic error is below SURE_DEG, float64 [N].

        features: float [N, 1404], normalised landmarks, NaN where not seen. ypr_deg [N, 3], rotation
        [N, 3, 3]: the estimate.
        """
        return _below(self.bias + self.quantities(features, ypr_deg, rotation) @ self.weights)

    def quantities(self, features: np.ndarray, ypr_deg: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        """float64 [N, 13], none negative; about 1 for a face like those trained on, at the range's edge,
        BEYOND_DEG beyond it, or without a point."""
        landmarks, mean = (
            np.asarray(features, dtype=np.float64).reshape(-1, POINTS, 3),
            self.mean.reshape(-1, 3),
        )
        seen = seen_points(landmarks).astype(np.float64)
        centre, spread = among(mean, seen)
        share = seen.mean(axis=1, keepdims=True)
        placed = np.nan_to_num(landmarks) @ rotation * spread[:, None] + centre[:, None]
        residual = ((placed - mean) * seen[..., None]).reshape(len(seen), -1) / np.sqrt(share)
        parts = np.square(residual @ self.basis)
        rest = np.maximum(np.square(residual).sum(axis=1) - parts.sum(axis=1), 0) / self.scale[-1]
        scaled = parts / self.scale[:-1]
        turn, shape = scaled[:, :TURNS].sum(axis=1), scaled[:, TURNS:].sum(axis=1)
        middle, half = self.range_deg.mean(axis=1), np.ptp(self.range_deg, axis=1) / 2
        place = np.abs(ypr_deg - middle)
        beyond = np.maximum(place - half, 0) / BEYOND_DEG
        inside = np.minimum(place, half) / half
        sizes = np.sqrt(np.column_stack([rest, shape, turn]))
        strange = np.maximum(sizes - STRANGE, 0)
        squared = np.square(np.hstack([strange, inside, beyond]))
        return np.concatenate([sizes, squared, 1 - share], axis=1)


def level_faces(
    landmarks: np.ndarray, rotation: np.ndarray, normalisation: Normalisation
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mean, basis and scale of :class:`Confidence`, from complete training faces and their true R_C."""
    whole = seen_points(landmarks).all(axis=1)
    landmarks, rotation = landmarks[whole], rotation[whole]
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
    share: np.ndarray,
) -> Confidence:
    """Fit the weights to estimates of faces that were not trained on.

    Parameters
    ----------
    faces: of :func:`level_faces`. features: float [N, 1404]. ypr_deg [N, 3] and rotation [N, 3, 3]:
    estimates; true [N, 3, 3]: R_C. share float [N]: what the probability is multiplied by before it is
    given, of :meth:`downstream_hpe.prediction.plausibility.FaceShapes.share`.

    Raises
    ------
    ModelError: an estimate is not finite.
    """
    if not np.isfinite(ypr_deg).all():
        raise ModelError("an estimate of a held-out face is not finite; train again with another seed")
    blank = Confidence(*faces, np.asarray(range_deg, dtype=np.float64), np.zeros(len(QUANTITIES)), 0.0)
    units, floors = np.array([SURE_DEG**2, *UNITS]), np.array([LEAST, *FLOORS])
    quantities = blank.quantities(features, ypr_deg, rotation)
    given = np.column_stack([np.ones(len(quantities)), quantities]) * units
    sure = geodesic_errors(rotation, true) < SURE_DEG

    def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        """Cross entropy and its gradient by the weights, in units."""
        above = parameters - floors / units
        exponent = -(SURE_DEG**2) / (given @ parameters)
        said = np.clip(-share * np.expm1(exponent), _LEAST_CHANCE, 1 - _LEAST_CHANCE)
        value = -np.mean(np.log(np.where(sure, said, 1 - said))) + PRIOR * np.square(above).sum()
        slope = np.where(sure, 1 / said, -1 / (1 - said)) * share * np.exp(exponent) * np.square(exponent)
        return float(value), given.T @ slope / (len(given) * SURE_DEG**2) + 2 * PRIOR * above

    start = np.maximum(floors / units, 0.5)
    bounds = [(floor, None) for floor in floors / units]
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x * units
    return Confidence(*faces, blank.range_deg, found[1:], float(found[0]))


def _below(squared_deg: np.ndarray) -> np.ndarray:
    """Probability of an error below SURE_DEG where its expected square is given."""
    return -np.expm1(-(SURE_DEG**2) / squared_deg)
