# SPDX-License-Identifier: MIT
"""The rigid fit that the encoder starts from: how a face is turned, and what is left of it when turned back.

A detector's landmarks tell a rotation without anything being learned. What is learned is by how much it is
off, from that rotation and from a few coordinates of the level face; so on faces that training has not seen
the answer is never far from the rigid fit's.

The rotation R that turns a level face a_p best onto the landmarks b_p maximises sum_p b_p^T R a_p, in
quaternions q^T N q (Horn, J. Opt. Soc. Am. A 4(4), 1987): the largest eigenvector of a 4 x 4 matrix. Its
powers tend to q q^T, and every entry of R is linear in that; so the fit is a few products of small matrices,
which a graph of tensors can hold.

Points that are not seen are NaN, and are in none of it.
"""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

from downstream_hpe.geometry.face_mesh import FEATURES, POINTS
from downstream_hpe.geometry.partial import among
from downstream_hpe.manifold.cosines import Manifolds

FACTORS = 9
"""Numbers of the three factor vectors."""
SQUARINGS = 5
"""Of N, divided by its norm and shifted; of a face all but the largest part falls below 1e-9 of that."""
SHIFT = 0.5
"""Added to the eigenvalues of N / |N|, so that the largest is largest in size, too."""
LEAST = 1e-12
"""Added to what is divided by."""
LEAST_SPREAD = 0.01
"""Added to the deviation of a coordinate, of faces of radius 1: what differs less is no difference."""


def _entries() -> np.ndarray:
    """R = T (q q^T), q = (w, x, y, z): float64 [9, 16], rows the entries of R, row-major."""
    products = np.zeros((9, 4, 4))
    for axis in range(3):
        products[4 * axis] = -np.eye(4)
        products[4 * axis, [0, 1 + axis], [0, 1 + axis]] = 1
        one, other = (axis + 1) % 3, (axis + 2) % 3
        # R[one, other] = 2 (q_one q_other - w q_axis), and R[other, one] with a plus.
        for entry, sign in ((3 * one + other, -1.0), (3 * other + one, 1.0)):
            products[entry, 1 + one, 1 + other] = products[entry, 1 + other, 1 + one] = 1
            products[entry, 0, 1 + axis] = products[entry, 1 + axis, 0] = sign
    return products.reshape(9, 16)


ENTRIES = _entries()
RIGID_PARTS = ("mean", "basis", "curves")


class RigidFit(nn.Module):
    """From normalised landmarks to the factor vectors of their rigid fit, coordinates of their shape, and the
    share of the points that is not seen.

    mean [1404]: the level face that is fitted. basis [1404, K]: coordinates are (level - mean) basis.
    curves [9, 4]: alpha, beta, gamma, phi of the cosines of yaw, pitch and roll.
    """

    mean: torch.Tensor
    basis: torch.Tensor
    curves: torch.Tensor

    def __init__(self, mean: np.ndarray, basis: np.ndarray, curves: np.ndarray) -> None:
        super().__init__()
        if mean.shape != (FEATURES,) or basis.shape[:1] != mean.shape or curves.shape != (FACTORS, 4):
            raise ValueError(f"no mean face, basis and curves: {mean.shape}, {basis.shape}, {curves.shape}")
        for name, value in zip(RIGID_PARTS, (mean, basis, curves), strict=True):
            self.register_buffer(name, torch.tensor(value, dtype=torch.float32))

    @staticmethod
    def of(level: np.ndarray, manifolds: Manifolds, components: int) -> RigidFit:
        """level: float [N, 468, 3], normalised training faces, each turned back by its own R_C.

        The basis: directions in which faces differ most once they are turned back by their rigid fit, each
        divided by its standard deviation, a little more. Partial faces are left out.
        """
        level = level[~np.isnan(level).any(axis=(1, 2))]
        faces = torch.from_numpy(level.reshape(len(level), FEATURES).astype(np.float64))
        mean = faces.mean(dim=0).numpy()
        curves = np.concatenate(manifolds.params)
        blank = RigidFit(mean, np.zeros((FEATURES, 0)), curves)
        residual = blank.residual(faces, torch.ones(len(faces), POINTS)).numpy()
        residual -= residual.mean(axis=0)
        variance, directions = np.linalg.eigh(residual.T @ residual / len(residual))
        kept = np.argsort(variance)[::-1][:components]
        basis = directions[:, kept] / (np.sqrt(np.maximum(variance[kept], 0)) + LEAST_SPREAD)
        return RigidFit(mean, basis, curves)

    @property
    def sees(self) -> int:
        """How many numbers it gives."""
        return FACTORS + int(self.basis.shape[1]) + 1

    def matrix(self) -> np.ndarray:
        """Normalised landmarks [1404] -> N of the mean face, float64 [1404, 16]."""
        face = self.mean.double().numpy().reshape(POINTS, 3)
        face = face - face.mean(axis=0)
        return np.einsum("pj,ijm->pim", face, ENTRIES.reshape(3, 3, 16)).reshape(FEATURES, 16)

    def rotation(self, features: torch.Tensor) -> torch.Tensor:
        """R_C of the rigid fit: normalised landmarks [N, 1404], 0 where not seen -> [N, 3, 3]."""
        flat = features @ torch.tensor(self.matrix(), dtype=features.dtype)
        powers = flat.reshape(-1, 4, 4) / (flat.norm(dim=1)[:, None, None] + LEAST)
        powers = powers + SHIFT * torch.eye(4, dtype=features.dtype)
        for _ in range(SQUARINGS):
            powers = powers @ powers
        powers = powers.reshape(-1, 16) / powers.diagonal(dim1=1, dim2=2).sum(dim=1, keepdim=True)
        return (powers @ torch.tensor(ENTRIES.T, dtype=features.dtype)).reshape(-1, 3, 3)

    def residual(self, points: torch.Tensor, seen: torch.Tensor) -> torch.Tensor:
        """Landmarks turned back by their rigid fit, less the mean face; 0 where not seen: float [N, 1404].

        points: normalised, 0 where not seen. seen: [N, 468], 1 or 0.
        """
        mean = self.mean.to(points.dtype).reshape(POINTS, 3)
        centre, spread = among(mean, seen.to(points.dtype))
        level = points.reshape(-1, POINTS, 3) @ self.rotation(points)
        placed = level * spread[:, None] + centre[:, None]
        return ((placed - mean) * seen[..., None]).reshape(-1, FEATURES)

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Normalised landmarks [N, 1404], NaN where not seen -> factor vectors [N, 9]; K coordinates of
        shape and the share not seen [N, K + 1]."""
        known = ~features.isnan()
        points = torch.where(known, features, 0.0)
        seen = known.reshape(-1, POINTS, 3).all(dim=2).to(features.dtype)
        share = seen.mean(dim=1, keepdim=True)
        alpha, beta, gamma, phi = self.curves.T
        angles = torch.repeat_interleave(_angles(self.rotation(points)), FACTORS // 3, dim=1)
        # What is not seen is taken for as far from the mean as what is.
        shape = self.residual(points, seen) @ self.basis / share
        return alpha * torch.cos(beta * angles + gamma) + phi, torch.cat([shape, 1 - share], dim=1)


def _angles(rotation: torch.Tensor) -> torch.Tensor:
    """Yaw, pitch and roll in radians of R_C: [N, 3, 3] -> [N, 3]."""
    r = rotation
    across = torch.hypot(r[:, 1, 2], r[:, 2, 2])
    yaw = torch.atan2(r[:, 0, 2], across)
    return torch.stack(
        [yaw, torch.atan2(r[:, 1, 2], r[:, 2, 2]), torch.atan2(-r[:, 0, 1], r[:, 0, 0])], dim=1
    )
