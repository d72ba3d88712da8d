# SPDX-License-Identifier: MIT
"""Ideal data: faces of a known shape space, rotated exactly, seen orthographically."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from downstream_hpe.geometry.face_mesh import FEATURES, POINTS
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.manifold.slabs import ArrayTensor

AXES = (np.arange(-50.0, 51, 25), np.arange(-40.0, 41, 20), np.arange(-30.0, 31, 15))

METADATA = {
    "headturn.schema_version": "1.0.0",
    "headturn.landmark_topology": "mediapipe-face-mesh-468",
    "headturn.conventions": json.dumps({"rotation": "R_C = Rx(-pitch) Ry(yaw) Rz(roll), row-major"}),
}


class Faces:
    """Faces mean + sum of four shapes; the same seed gives the same shape space."""

    def __init__(self, seed: int = 0) -> None:
        self._shapes = np.random.default_rng(seed).normal(size=(5, POINTS, 3))

    def draw(self, count: int, rng: np.random.Generator) -> np.ndarray:
        """float64 [count, 468, 3], frontal, centred."""
        weights = rng.normal(scale=0.15, size=(count, 5))
        weights[:, 0] = 1.0
        faces = np.tensordot(weights, self._shapes, 1)
        return faces - faces.mean(axis=1, keepdims=True)


def turned(faces: np.ndarray, ypr_deg: np.ndarray) -> np.ndarray:
    """Face i at pose i: [N, 468, 3]."""
    return faces @ np.swapaxes(rotation_from_angles(ypr_deg), -1, -2)


def tensor(faces: np.ndarray, noise: float = 0.0, rng: np.random.Generator | None = None) -> ArrayTensor:
    """Every face at every pose of AXES, each with RMS 1."""
    scaled = faces / np.sqrt((faces**2).sum(-1).mean(-1))[:, None, None]
    rotation = rotation_from_angles(np.stack(np.meshgrid(*AXES, indexing="ij"), axis=-1))
    values = np.einsum("abcij,npj->nabcpi", rotation, scaled, optimize=True)
    values = values.reshape(len(faces), *rotation.shape[:3], FEATURES)
    if rng is not None:
        values = values + rng.normal(scale=noise, size=values.shape)
    return ArrayTensor(values, np.ones(values.shape[:4], dtype=bool))


def rows(face: np.ndarray, subject: str, axes: tuple[np.ndarray, ...] = AXES, split: str = "train") -> dict:
    """Columns of one head on a grid, every pose detected."""
    index = np.stack(np.meshgrid(*(np.arange(len(a)) for a in axes), indexing="ij"), -1).reshape(-1, 3)
    ypr = np.stack([axis[index[:, k]] for k, axis in enumerate(axes)], axis=-1)
    count = len(ypr)
    pixels = 128 + 60 * turned(np.broadcast_to(face, (count, POINTS, 3)), ypr)
    return {
        "subject": np.array([subject] * count),
        "expression": np.array(["neutral"] * count),
        "split": np.array([split] * count),
        **{f"{name}_deg": ypr[:, k] for k, name in enumerate(("yaw", "pitch", "roll"))},
        **{f"{name}_index": index[:, k].astype(np.int16) for k, name in enumerate(("yaw", "pitch", "roll"))},
        "rotation": rotation_from_angles(ypr).reshape(-1, 9),
        "detected": np.ones(count, dtype=bool),
        "landmarks": pixels.reshape(count, -1).astype(np.float32),
    }


def drop(columns: dict, row: int) -> None:
    """Make one row a missed detection."""
    columns["detected"][row] = False
    columns["landmarks"][row] = np.nan


def write(path: Path, columns: dict, metadata: dict[str, str] = METADATA) -> None:
    """One Parquet file as headturn build lays it out."""
    arrays = {
        name: pa.array(values)
        if values.ndim == 1
        else pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), values.shape[1])
        for name, values in columns.items()
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    pq.write_table(pa.table(arrays).replace_schema_metadata(metadata), path)
