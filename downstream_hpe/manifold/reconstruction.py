# SPDX-License-Identifier: MIT
"""Pose by reconstruction: the angles whose tensor fit comes closest to the landmarks.

    min over a, y, p, r of  | x - W x1 a x2 f_y(y) x3 f_p(p) x4 f_r(r) |^2

For given angles the identity vector a is a linear least-squares problem, so only three unknowns
are searched (variable projection), by Levenberg-Marquardt with analytic derivatives.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from downstream_hpe.geometry.face_mesh import FEATURES
from downstream_hpe.geometry.normalise import Normalisation, normalise
from downstream_hpe.manifold.cosines import Manifolds, cosine_slopes, cosines

BATCH = 256
STARTS = 5
"""Starting angles tried an axis."""
BEYOND = 0.5
"""Of an axis' width: so far past either end its angles are searched. Cosines repeat, and a step across many
periods would come back as thousands of degrees."""


@dataclass(frozen=True)
class Reconstructed:
    """ypr_deg float64 [N, 3]; identity float64 [N, Ri]; residual float64 [N], |x - fit| / |x|;
    converged bool [N]."""

    ypr_deg: np.ndarray
    identity: np.ndarray
    residual: np.ndarray
    converged: np.ndarray


class ReconstructionEstimator:
    """Estimates pose from landmarks with a core tensor and its manifolds.

    core: W, float [Ri, Ry, Rp, Rr, F]. normalisation: the one the tensor was made with.

    The features are first turned onto an orthonormal basis of the core's Ri Ry Rp Rr rows (135 of
    1404 dimensions with the paper's ranks); what is outside no fit can reach, so nothing is lost.
    """

    def __init__(self, core: np.ndarray, manifolds: Manifolds, normalisation: Normalisation = "rms") -> None:
        ranks = core.shape[:4]
        rows = core.reshape(-1, core.shape[4])
        _, singular, basis = np.linalg.svd(rows, full_matrices=False)
        self._basis = basis[singular > 1e-12 * singular[0]]
        self._core = (rows @ self._basis.T).reshape(*ranks, -1)  # [Ri, Ry, Rp, Rr, Q]
        self.manifolds = manifolds
        self.normalisation = normalisation
        middle, half = manifolds.range_deg.mean(axis=1), np.ptp(manifolds.range_deg, axis=1) / 2
        self._low, self._high = middle - (1 + 2 * BEYOND) * half, middle + (1 + 2 * BEYOND) * half
        axes = [np.linspace(low, high, STARTS) for low, high in manifolds.range_deg]
        self._starts = np.array(list(product(*axes)))
        self._start_bases = np.linalg.qr(self._atoms(self._starts)[0])[0]  # [S, Q, Ri]

    def from_landmarks(self, landmarks: np.ndarray) -> Reconstructed:
        """float [N, 468, 3], isotropic, frame C, finite."""
        values = normalise(np.asarray(landmarks, dtype=np.float64), self.normalisation)
        return self.estimate(values.reshape(len(values), FEATURES))

    def estimate(
        self, features: np.ndarray, *, max_steps: int = 50, tolerance_deg: float = 1e-5
    ) -> Reconstructed:
        """Normalised landmarks, float [N, F].

        Stops when every step of a batch is below tolerance_deg; rows that were not there yet after
        max_steps are marked as not converged.
        """
        parts = [
            self._estimate(features[first : first + BATCH], max_steps, tolerance_deg)
            for first in range(0, len(features), BATCH)
        ]
        if not parts:
            ranks = self._core.shape[0]
            return Reconstructed(np.empty((0, 3)), np.empty((0, ranks)), np.empty(0), np.empty(0, dtype=bool))
        return Reconstructed(*(np.concatenate(column) for column in zip(*parts, strict=True)))

    def objective(self, feature: np.ndarray, ypr_deg: np.ndarray, identity: np.ndarray) -> float:
        """The squared distance that is minimised, of one feature vector [F]."""
        seen = self._basis @ feature
        fit = self._atoms(np.asarray(ypr_deg)[None])[0][0] @ identity
        return float(((seen - fit) ** 2).sum() + (feature**2).sum() - (seen**2).sum())

    def residual_jacobian(self, features: np.ndarray, ypr_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Residual [N, Q] at the best identity and its derivative by the angles [N, Q, 3], per radian.

        d r = -P dM a - (M^+)^T dM^T r, with M the atoms [Q, Ri], a = M^+ x and P = I - M M^+
        (Golub and Pereyra, Inverse Problems 19, 2003, Eq. 8).
        """
        seen = features @ self._basis.T
        residual, _, jacobian = self._linearise(seen, ypr_deg)
        return residual, jacobian

    def _atoms(self, ypr_deg: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """M [N, Q, Ri], and its three derivatives by the angles, per radian."""
        params = self.manifolds.params
        f = [cosines(p, ypr_deg[:, k]) for k, p in enumerate(params)]
        d = [cosine_slopes(p, ypr_deg[:, k]) for k, p in enumerate(params)]
        every = [f, [d[0], f[1], f[2]], [f[0], d[1], f[2]], [f[0], f[1], d[2]]]
        ri, q = self._core.shape[0], self._core.shape[-1]
        flat = np.moveaxis(self._core, 0, -1).reshape(-1, q * ri)
        atoms = []
        for y, p, r in every:
            weights = (y[:, :, None, None] * p[:, None, :, None] * r[:, None, None, :]).reshape(len(y), -1)
            atoms.append((weights @ flat).reshape(-1, q, ri))
        return atoms[0], atoms[1:]

    def _linearise(self, seen: np.ndarray, ypr_deg: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        atoms, slopes = self._atoms(ypr_deg)
        q, upper = np.linalg.qr(atoms)
        identity = np.linalg.solve(upper, np.einsum("nqi,nq->ni", q, seen)[..., None])[..., 0]
        residual = seen - np.einsum("nqi,ni->nq", atoms, identity)
        columns = []
        for slope in slopes:
            moved = np.einsum("nqi,ni->nq", slope, identity)
            moved -= np.einsum("nqi,ni->nq", q, np.einsum("nqi,nq->ni", q, moved))
            turned = np.linalg.solve(
                np.swapaxes(upper, 1, 2), np.einsum("nqi,nq->ni", slope, residual)[..., None]
            )
            columns.append(-moved - np.einsum("nqi,ni->nq", q, turned[..., 0]))
        return residual, identity, np.stack(columns, axis=-1)

    def _estimate(self, features: np.ndarray, max_steps: int, tolerance_deg: float) -> tuple[np.ndarray, ...]:
        features = np.asarray(features, dtype=np.float64)
        seen = features @ self._basis.T
        explained = (np.einsum("sqi,nq->nsi", self._start_bases, seen, optimize=True) ** 2).sum(axis=-1)
        angles = self._starts[np.argmax(explained, axis=1)]
        residual, identity, jacobian = self._linearise(seen, angles)
        lost = (residual**2).sum(axis=1)
        damping = np.full(len(features), 1e-3)
        converged = np.zeros(len(features), dtype=bool)
        for _ in range(max_steps):
            normal = np.einsum("nqi,nqj->nij", jacobian, jacobian)
            slope = np.einsum("nqi,nq->ni", jacobian, residual)
            diagonal = np.einsum("nii->ni", normal)
            damped = normal + (damping[:, None] * diagonal + 1e-12)[..., None] * np.eye(3)
            step = -np.rad2deg(np.linalg.solve(damped, slope[..., None])[..., 0])
            step = np.clip(angles + step, self._low, self._high) - angles
            moved = self._linearise(seen, angles + step)
            better = (now := (moved[0] ** 2).sum(axis=1)) <= lost
            # A step too small to matter ends the search, also where rounding keeps it from paying.
            converged |= np.abs(step).max(axis=1) < tolerance_deg
            angles[better] += step[better]
            lost[better] = now[better]
            for old, new in zip((residual, identity, jacobian), moved, strict=True):
                old[better] = new[better]
            damping = np.where(better, damping / 10, damping * 10)
            if converged.all():
                break
        outside = (features**2).sum(axis=1) - (seen**2).sum(axis=1)
        error = np.sqrt(np.maximum(lost + outside, 0.0) / (features**2).sum(axis=1))
        return angles, identity, error, converged
