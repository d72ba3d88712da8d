# SPDX-License-Identifier: MIT
"""Pose manifolds: each column of a pose factor as one cosine of its angle.

    f(w) = alpha cos(beta w + gamma) + phi,    w in radians

beta is a number of turns of the curve a turn of the head: 1 for exact landmarks seen from afar.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from downstream_hpe.errors import DataError
from downstream_hpe.manifold.tucker import Decomposition

MIN_SAMPLES = 4
"""A cosine has four parameters."""

SLOWEST = 0.25
"""Least phase, in radians, that a curve runs through over the sampled angles: where a column is a
straight line, slower cosines only trade a larger alpha for the same values."""

FASTEST = 3.0
"""Largest beta. A turned face is beta 1; a lens adds harmonics, the k-th by (r / d)^(k - 1), and a face of
radius r, 0.08 m, is hardly nearer than d = 0.25 m: what is left beyond the third is a thirtieth."""

CLEAR = 0.75
"""Of the Nyquist limit: nearer to it two curves differ at the samples by ever less, and alpha runs away."""

NARROWEST_DEG = float(np.rad2deg(SLOWEST / FASTEST))
"""A narrower range has no cosine between the two."""


@dataclass(frozen=True)
class Manifolds:
    """The curves of the three pose factors.

    params: three float64 [K, 4], rows (alpha, beta, gamma, phi), of yaw, pitch, roll.
    range_deg: float64 [3, 2], the angles the curves were fitted to.
    """

    params: tuple[np.ndarray, np.ndarray, np.ndarray]
    range_deg: np.ndarray

    def values(self, ypr_deg: np.ndarray) -> tuple[np.ndarray, ...]:
        """Factor vectors of poses, float [N, 3] -> three float64 [N, K]."""
        return tuple(cosines(p, ypr_deg[:, k]) for k, p in enumerate(self.params))


def fit_manifolds(fit: Decomposition, axes_deg: tuple[np.ndarray, ...]) -> Manifolds:
    """Cosines through every column of the three pose factors. axes_deg: the grid's angles."""
    y, p, r = (fit_cosines(f, a) for f, a in zip(fit.poses, axes_deg, strict=True))
    return Manifolds((y, p, r), np.array([[axis[0], axis[-1]] for axis in axes_deg], dtype=np.float64))


def cosines(params: np.ndarray, angles_deg: np.ndarray) -> np.ndarray:
    """f(w) of each curve: params [K, 4], angles float [...] -> float64 [..., K]."""
    alpha, beta, gamma, phi = np.asarray(params, dtype=np.float64).T
    w = np.deg2rad(np.asarray(angles_deg, dtype=np.float64))[..., None]
    return alpha * np.cos(beta * w + gamma) + phi


def cosine_slopes(params: np.ndarray, angles_deg: np.ndarray) -> np.ndarray:
    """df/dw of each curve, per radian: params [K, 4], angles float [...] -> float64 [..., K]."""
    alpha, beta, gamma, _ = np.asarray(params, dtype=np.float64).T
    w = np.deg2rad(np.asarray(angles_deg, dtype=np.float64))[..., None]
    return -alpha * beta * np.sin(beta * w + gamma)


def fit_cosines(factor: np.ndarray, angles_deg: np.ndarray) -> np.ndarray:
    """The least-squares cosine through each column of a factor.

    Variable projection (Golub and Pereyra 1973): for a given beta the curve is linear in
    a cos(beta w) + b sin(beta w) + phi, so only beta is searched, over all values from the
    slowest that the samples can tell from a line to FASTEST, or CLEAR of the Nyquist limit of their
    closest pair, the paper's Fourier start within these among them. The best is refined by Brent's
    method. The squared error is therefore never above that of the start, whatever the column.

    Parameters
    ----------
    factor: float [D, K], one row an angle. angles_deg: float [D], rising, D >= 4.

    Returns
    -------
    float64 [K, 4]: alpha >= 0, beta > 0, gamma in (-pi, pi], phi. A constant column gives
    (0, 1, 0, its value).

    Raises
    ------
    DataError: too few samples, angles that do not rise or span less than NARROWEST_DEG, or values that
        are not finite.
    """
    values = np.asarray(factor, dtype=np.float64)
    angles = np.deg2rad(np.asarray(angles_deg, dtype=np.float64))
    if values.ndim != 2 or angles.shape != values.shape[:1]:
        raise DataError(f"expected a factor [D, K] and D angles, got {values.shape} and {angles.shape}")
    if len(angles) < MIN_SAMPLES:
        raise DataError(f"{len(angles)} angles are too few for a cosine; expected at least {MIN_SAMPLES}")
    if not np.isfinite(values).all() or not (np.diff(angles) > 0).all():
        raise DataError("expected finite factors and rising angles")
    slowest, fastest = _bounds(angles)
    if slowest >= fastest:
        raise DataError(f"angles of {np.rad2deg(np.ptp(angles)):.3g}° in all are too narrow for a cosine")
    search = np.geomspace(slowest, fastest, 400)
    # 1 is where ideal data lie, and what a constant column gets.
    betas = np.concatenate([[1.0] if slowest <= 1.0 <= fastest else [], search])
    return np.stack([_fit_column(column, angles, betas) for column in values.T])


def fourier_start(column: np.ndarray, angles_deg: np.ndarray) -> np.ndarray:
    """(alpha, beta, gamma, phi) with beta at the strongest Fourier bin of the column, or at the nearest
    that is searched, [D] -> [4]."""
    angles = np.deg2rad(np.asarray(angles_deg, dtype=np.float64))
    return _solve(np.asarray(column, dtype=np.float64), angles, _fourier_beta(column, angles))[0]


def _fourier_beta(column: np.ndarray, angles: np.ndarray) -> float:
    even = np.linspace(angles[0], angles[-1], len(angles))
    spectrum = np.abs(np.fft.rfft(np.interp(even, angles, column - column.mean())))
    strongest = 1 + int(np.argmax(spectrum[1:]))
    return float(np.clip(2 * np.pi * strongest / (len(angles) * (even[1] - even[0])), *_bounds(angles)))


def _bounds(angles: np.ndarray) -> tuple[float, float]:
    """Least and largest beta of angles in radians."""
    return SLOWEST / float(np.ptp(angles)), min(FASTEST, CLEAR * np.pi / float(np.diff(angles).min()))


def _fit_column(column: np.ndarray, angles: np.ndarray, betas: np.ndarray) -> np.ndarray:
    if np.ptp(column) <= 1e-12 * np.abs(column).max(initial=1e-300):
        return np.array([0.0, 1.0, 0.0, column.mean()])
    tried = np.append(betas, _fourier_beta(column, angles))
    left = np.linalg.svd(_basis(angles, tried), full_matrices=False)[0]
    explained = np.einsum("bdk,d->bk", left, column)
    best = float(tried[np.argmax((explained**2).sum(axis=1))])
    step = betas[-1] / betas[-2]

    def lost(beta: float) -> float:
        return _solve(column, angles, beta)[1]

    refined = minimize_scalar(
        lost,
        bounds=(max(best / step, betas[-400]), min(best * step, betas[-1])),
        method="bounded",
        options={"xatol": 1e-12},
    )
    candidates = [_solve(column, angles, beta) for beta in (best, float(refined.x))]
    return min(candidates, key=lambda candidate: candidate[1])[0]


def _basis(angles: np.ndarray, betas: np.ndarray) -> np.ndarray:
    """cos, sin and 1 at each angle, for each beta: [B, D, 3]."""
    phase = betas[:, None] * angles
    return np.stack([np.cos(phase), np.sin(phase), np.ones_like(phase)], axis=-1)


def _solve(column: np.ndarray, angles: np.ndarray, beta: float) -> tuple[np.ndarray, float]:
    """Parameters and squared error of the best cosine of one beta."""
    basis = _basis(angles, np.array([beta]))[0]
    a, b, phi = np.linalg.lstsq(basis, column, rcond=1e-10)[0]
    # a cos + b sin = alpha cos(beta w + gamma) with gamma = atan2(-b, a).
    residual = column - basis @ (a, b, phi)
    return np.array([np.hypot(a, b), beta, np.arctan2(-b, a), phi]), float(residual @ residual)
