# SPDX-License-Identifier: GPL-3.0-or-later
"""What is measured of one image: was the face found, how far off are its landmarks and its pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pyarrow as pa

from generator.dataset.format.open import as_array
from generator.dataset.format.row_cameras import COLUMNS as CAMERA
from generator.dataset.format.row_cameras import RowCameras
from generator.geometry.rigid import fit_rotations
from generator.geometry.rotation import (
    CAMERA_FROM_GRAPHICS,
    angles_from_rotation,
    geodesic_deg,
    rotation_from_angles,
)
from generator.landmarks.topology import Topology


@dataclass(frozen=True)
class Measure:
    """One number of an image. name: in tables; unit: of its value; signed: zero is best, not the least."""

    name: str
    meaning: str
    unit: str
    signed: bool = False


LANDMARKS = Measure(
    "landmarks", "mean distance of detected and exact landmarks, of the outer eye corners' distance", "%"
)
POSE = (
    Measure("geodesic", "angle between the estimated rotation and R_C", "°"),
    Measure("yaw", "error without its sign", "°"),
    Measure("pitch", "error without its sign", "°"),
    Measure("roll", "error without its sign", "°"),
    Measure("yaw turn", "estimated minus exact", "°", signed=True),
    Measure("pitch turn", "estimated minus exact", "°", signed=True),
    Measure("roll turn", "estimated minus exact", "°", signed=True),
)
DETECTOR = (LANDMARKS, *POSE)
"""Of the detector, in the order of :func:`detector_measures`; of a model without the landmarks."""

COLUMNS = [
    *("sample_id", "subject", "rotation", *CAMERA, "detected", "landmarks", "landmarks_exact"),
]
"""What :func:`detector_measures` reads."""


def detector_measures(batch: pa.RecordBatch, topology: Topology) -> np.ndarray:
    """DETECTOR of each row, float64 [N, 8]; NaN where no face was found.

    The pose is that of the rigid fit (Umeyama) of the reference face to the detected landmarks. The distance
    of the eyes is that of the exact landmarks in space, so a turned head does not make errors larger.
    """
    found = as_array(batch, "landmarks").astype(np.float64)
    measures = np.full((len(batch), len(DETECTOR)), np.nan)
    rows = np.flatnonzero(as_array(batch, "detected").astype(bool) & np.isfinite(found).all(axis=(1, 2)))
    if not len(rows):
        return measures
    exact = RowCameras.of(batch)[rows].pixels(as_array(batch, "landmarks_exact")[rows])
    eyes = exact[:, topology.right_eye_outer] - exact[:, topology.left_eye_outer]
    distance = np.linalg.norm(found[rows, :, :2] - exact[..., :2], axis=-1)
    anchored = np.isfinite(distance)
    total = np.where(anchored, distance, 0.0).sum(axis=1)
    mean = np.divide(total, anchored.sum(axis=1), out=np.full(len(rows), np.nan), where=anchored.any(axis=1))
    measures[rows, 0] = 100 * mean / np.linalg.norm(eyes, axis=1)
    estimated = fit_rotations(topology.reference_face() @ CAMERA_FROM_GRAPHICS, found[rows])
    measures[rows, 1:] = pose_measures(estimated, as_array(batch, "rotation")[rows].reshape(-1, 3, 3))
    return measures


def model_measures(angles_deg: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """POSE of each row, float64 [N, 7]: what a model said against R_C.

    angles_deg: float64 [N, 3], yaw, pitch, roll; NaN where the model said nothing. rotation: [N, 3, 3].
    """
    measures = np.full((len(angles_deg), len(POSE)), np.nan)
    said = np.isfinite(angles_deg).all(axis=1)
    if said.any():
        measures[said] = pose_measures(rotation_from_angles(angles_deg[said]), rotation[said])
    return measures


def pose_measures(estimated: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """POSE of estimated rotations, float64 [N, 3, 3], against R_C: float64 [N, 7]."""
    turn = (angles_from_rotation(estimated) - angles_from_rotation(rotation) + 180) % 360 - 180
    return np.column_stack([geodesic_deg(rotation, estimated), np.abs(turn), turn])


def names(measures: Sequence[Measure]) -> list[str]:
    """Their names."""
    return [measure.name for measure in measures]
