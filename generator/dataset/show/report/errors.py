# SPDX-License-Identifier: GPL-3.0-or-later
"""Detector minus exact, row by row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from generator.dataset.format.open import as_array
from generator.dataset.format.row_cameras import RowCameras
from generator.geometry.rigid import fit_similarity
from generator.geometry.rotation import angles_from_rotation, geodesic_deg
from generator.landmarks.topology import Topology

ENOUGH = 30
"""Anchored points below which a row is not compared: a fit to fewer says little."""


@dataclass(frozen=True, eq=False)
class RowErrors:
    """Errors of the K rows of a batch that have both kinds of landmarks.

    rows         int64 [K], their places in the batch
    region       float64 [K, regions, 4]: mean dx, mean dy, mean distance, mean squared distance of the
                 region's points, pixels (frame C: x right, y down); NaN where a region has no anchor
    pose_deg     float64 [K, 3]: yaw, pitch, roll of the detector minus the exact ones
    geodesic_deg float64 [K]: angle between the detector's rotation and the exact one
    mm_per_px    float64 [K], at the depth of the pivot
    distance_px  float64 [K, P]: of each point, NaN without an anchor
    shift_head   float64 [K, P, 3]: the error with the pose undone, pixels, the mean of its depth removed
    """

    rows: np.ndarray
    region: np.ndarray
    pose_deg: np.ndarray
    geodesic_deg: np.ndarray
    mm_per_px: np.ndarray
    distance_px: np.ndarray
    shift_head: np.ndarray


def row_errors(batch: pa.RecordBatch, topology: Topology) -> RowErrors:
    """Compare the detector with the mesh on every row of a batch that has both.

    The pose error is that of a rigid fit (Umeyama) of the exact landmarks, as the camera
    projects them, onto the detected ones: the identity for a detector without error.
    """
    exact_mm = as_array(batch, "landmarks_exact")
    anchored = np.isfinite(exact_mm).all(axis=2)
    rows = np.flatnonzero(as_array(batch, "detected").astype(bool) & (anchored.sum(axis=1) >= ENOUGH))
    cameras = RowCameras.of(batch)[rows]
    exact = cameras.pixels(exact_mm[rows])
    found = as_array(batch, "landmarks")[rows].astype(np.float64)
    rotation = as_array(batch, "rotation")[rows].reshape(-1, 3, 3)

    error = found - exact
    flat = error[..., :2]
    distance = np.linalg.norm(flat, axis=-1)
    means = [_means(flat[:, points], distance[:, points]) for points in topology.regions.values()]
    seen = _fitted_rotations(exact, found, anchored[rows]) @ rotation
    # The origin of the detector's depth is its own; without this it would leak into x and y below.
    error[..., 2] -= np.nanmean(error[..., 2], axis=1, keepdims=True)
    turn = angles_from_rotation(seen) - angles_from_rotation(rotation)
    return RowErrors(
        rows=rows,
        region=np.stack(means, axis=1),
        pose_deg=(turn + 180) % 360 - 180,
        geodesic_deg=geodesic_deg(rotation, seen),
        mm_per_px=cameras.translation_mm[:, 2] / cameras.matrix[:, 0, 0],
        distance_px=distance,
        shift_head=error @ rotation,
    )


def _means(error: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Mean dx, dy, distance and squared distance over the points that are there. [K, L, 2] -> [K, 4]."""
    there = np.isfinite(distance)
    count = there.sum(axis=1)
    values = np.stack([error[..., 0], error[..., 1], distance, distance**2], axis=-1)
    total = np.where(there[..., None], values, 0.0).sum(axis=1)
    return np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], np.nan)


def _fitted_rotations(exact: np.ndarray, found: np.ndarray, anchored: np.ndarray) -> np.ndarray:
    """The rotation of each row's similarity from exact to found points. float64 [K, 3, 3]."""
    fits = [fit_similarity(a[m], b[m]).rotation for a, b, m in zip(exact, found, anchored, strict=True)]
    return np.array(fits).reshape(-1, 3, 3)
