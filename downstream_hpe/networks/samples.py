# SPDX-License-Identifier: MIT
"""What training draws its batches from: faces of the tables, and points of the manifolds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch

from downstream_hpe.errors import ModelError
from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.geometry.rotation import angles_from_rotation
from downstream_hpe.manifold.tensor_model import TensorModel
from downstream_hpe.networks.augment import disturbed, levelled, shapes_of
from downstream_hpe.networks.recipe import Recipe
from downstream_hpe.tables.rows import Rows

CURVE_STEP_DEG = 0.1
CURVE_MARGIN_DEG = 10.0
"""Curves are sampled past the data by this much, so that a head does not end where they do."""


@dataclass(frozen=True)
class Samples:
    """faces float32 [N, 468, 3], normalised, level where shapes are, NaN where a point is not seen; rotation
    float64 [N, 3, 3]; shapes float32 [H, 468, 3] of :func:`shapes_of`, and no factors; or factors float32
    [N, 9] of the grid's poses."""

    faces: np.ndarray
    rotation: np.ndarray
    shapes: np.ndarray | None
    factors: np.ndarray | None
    model: TensorModel

    @staticmethod
    def of(rows: Rows, model: TensorModel, recipe: Recipe) -> Samples:
        faces = normalise(rows.landmarks, model.normalisation).astype(np.float32)
        if recipe.continuous:
            level = levelled(faces, rows.rotation)
            shapes = shapes_of(level, rows.heads, rows.ypr_deg)
            return Samples(level, rows.rotation, shapes, None, model)
        columns = []
        for k, (axis, factor) in enumerate(zip(model.axes_deg, model.poses, strict=True)):
            place = np.abs(rows.ypr_deg[:, k, None] - axis).argmin(axis=1)
            if np.abs(rows.ypr_deg[:, k] - axis[place]).max() > 1e-6:
                raise ModelError("the paper's recipe needs poses on the grid; use the continuous one")
            columns.append(factor[place])
        return Samples(faces, rows.rotation, None, np.concatenate(columns, axis=1), model)

    def batch(
        self, chosen: np.ndarray, recipe: Recipe, rng: np.random.Generator
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Normalised landmarks [B, 1404], factor vectors [B, 9] and R_C [B, 3, 3]."""
        faces, rotation = self.faces[chosen], self.rotation[chosen]
        if self.shapes is None:
            assert self.factors is not None
            factors = self.factors[chosen]
        else:
            faces, rotation = disturbed(faces, rotation, self.shapes, recipe.disturbances, rng)
            faces = normalise(faces, self.model.normalisation)
            factors = np.concatenate(self.model.manifolds.values(angles_from_rotation(rotation)), axis=1)
        features = faces.reshape(len(chosen), -1)
        arrays = (features, factors, rotation)
        seen, targets, turned = (torch.from_numpy(np.asarray(a, dtype=np.float32)) for a in arrays)
        return seen, targets, turned


class Curves:
    """Points of the cosine curves at fine steps: what the heads learn from."""

    def __init__(self, model: TensorModel, ypr_deg: np.ndarray) -> None:
        ranges = model.manifolds.range_deg
        self._low = np.minimum(ranges[:, 0], ypr_deg.min(axis=0)) - CURVE_MARGIN_DEG
        high = np.maximum(ranges[:, 1], ypr_deg.max(axis=0)) + CURVE_MARGIN_DEG
        self._steps = ((high - self._low) / CURVE_STEP_DEG).astype(int)
        self._manifolds = model.manifolds
        self.variance = float(np.mean([factor.var() for factor in model.poses]))

    def draw(self, count: int, rng: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
        """Factor vectors float32 [count, 9] and their angles float32 [count, 3]."""
        angles = self._low + CURVE_STEP_DEG * rng.integers(self._steps + 1, size=(count, 3))
        points = np.concatenate(self._manifolds.values(angles), axis=1)
        return torch.from_numpy(points.astype(np.float32)), torch.from_numpy(angles.astype(np.float32))
