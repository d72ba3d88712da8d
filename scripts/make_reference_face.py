# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure generator/landmarks/reference_face.csv: the mean face of the detector.

    python scripts/make_reference_face.py

Builds 24 neutral parametric heads at small rotations, turns what the detector
found back by the exact labels, aligns, averages and mirrors. About a minute.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from scipy.optimize import linear_sum_assignment

from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.landmarks.detector import LEFT_EYE_OUTER, POINTS, RIGHT_EYE_OUTER

TARGET = Path(__file__).resolve().parents[1] / "generator" / "landmarks" / "reference_face.csv"
EYE_DISTANCE_MM = 90.0


def measured_faces() -> np.ndarray:
    """Landmarks turned back to pose zero, frame U, one face a row: float64 [N, 468, 3]."""
    with tempfile.TemporaryDirectory() as folder:
        build = "build --count 24 --seed 2024 --images none --resolution 384 --lens 200 --samples 2"
        grid = ["--yaw=-15,15,15", "--pitch=-15,15,15", "--roll=0,0,10"]
        command = [sys.executable, "-m", "generator.cli", *build.split(), *grid, "--out", f"{folder}/d"]
        subprocess.run(command, check=True)
        table = pq.read_table(f"{folder}/d/data", columns=["subject", "rotation", "detected", "landmarks"])
    seen = table.filter(table["detected"])
    rotations = np.stack(seen["rotation"].to_numpy()).reshape(-1, 3, 3)
    landmarks = np.stack(seen["landmarks"].to_numpy()).reshape(-1, POINTS, 3).astype(np.float64)
    return landmarks @ rotations @ CAMERA_FROM_GRAPHICS


def mean_face(faces: np.ndarray) -> np.ndarray:
    """Mean shape, rotations kept: only place and size are taken out of each face."""
    centred = faces - faces.mean(1, keepdims=True)
    sized = centred / np.sqrt((centred**2).sum((1, 2), keepdims=True))
    return sized.mean(0)


def mirror_pairs(face: np.ndarray) -> np.ndarray:
    """Index of each point's mirror image, int [468]: the one-to-one pairing of least distance."""
    centred = face - face.mean(0)
    mirrored = centred * [-1.0, 1.0, 1.0]
    distance = np.linalg.norm(mirrored[:, None] - centred[None], axis=2)
    _, pairs = linear_sum_assignment(distance + distance.T)
    if (pairs[pairs] != np.arange(len(face))).any():
        raise SystemExit("the mean face is not symmetric enough to pair its points")
    return pairs


def main() -> None:
    """Measure and write the file."""
    face = mean_face(measured_faces())
    pairs = mirror_pairs(face)
    face -= face.mean(0)
    face = (face + face[pairs] * [-1.0, 1.0, 1.0]) / 2
    face *= EYE_DISTANCE_MM / np.linalg.norm(face[LEFT_EYE_OUTER] - face[RIGHT_EYE_OUTER])
    face -= face.mean(0)
    header = "x,y,z of the 468 points in mm, frame U; made by scripts/make_reference_face.py"
    np.savetxt(TARGET, face, fmt="%.2f", delimiter=",", header=header)
    print(f"{TARGET.name}: {len(face)} points, {np.ptp(face, axis=0).round(1)} mm")


if __name__ == "__main__":
    main()
