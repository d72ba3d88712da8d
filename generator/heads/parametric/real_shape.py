# SPDX-License-Identifier: GPL-3.0-or-later
"""What makes MakeHuman's faces shaped like people's: a correction of the base mesh, and how faces vary.

``real_shape.npz`` is written by scripts/fit_faces.py from figures of real-shaped faces: offsets of vertices
in the manner of MakeHuman's targets, fitted to the mean and the covariance of those faces alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

FILE = Path(__file__).with_name("real_shape.npz")

STEP = 1e-5
"""What offsets are stored in multiples of, dm."""

PREFIX = "real/"
"""Of the names of the targets here."""


@dataclass(frozen=True)
class RealShape:
    """Offsets of the base mesh.

    vertices: int64 [K], indices into MakeHuman's base mesh. correction: float64 [K, 3] dm, added to every
    head. targets: name -> float64 [K, 3] dm, the change by one standard deviation of each factor.
    """

    vertices: np.ndarray
    correction: np.ndarray
    targets: dict[str, np.ndarray]


@lru_cache(maxsize=1)
def real_shape() -> RealShape:
    """Read the file that comes along."""
    with np.load(FILE, allow_pickle=False) as stored:
        vertices = stored["vertices"].astype(np.int64)
        offsets = stored["offsets"] * STEP
    names = [f"{PREFIX}{number:02d}" for number in range(1, len(offsets))]
    return RealShape(vertices, offsets[0], dict(zip(names, offsets[1:], strict=True)))


def write_real_shape(vertices: np.ndarray, correction: np.ndarray, targets: np.ndarray) -> None:
    """Store a correction [K, 3] and targets [M, K, 3], dm, of vertices int [K] of the base mesh."""
    offsets = np.round(np.concatenate([correction[None], targets]) / STEP)
    if np.abs(offsets).max() > np.iinfo(np.int16).max:
        raise ValueError("an offset is larger than 32 mm: this is no correction of a face")
    np.savez_compressed(
        FILE,
        made_by=np.array("scripts/fit_faces.py; offsets in 1e-5 dm of vertices of MakeHuman's base mesh"),
        vertices=vertices.astype(np.int32),
        offsets=offsets.astype(np.int16),
    )
    real_shape.cache_clear()
