# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the two mean faces in generator/landmarks: as the detector sees it, and as it is.

    python scripts/make_reference_face.py

Builds 24 neutral parametric heads at small rotations. ``reference_face.csv`` is what the detector
found, turned back by the exact labels; ``surface_face.csv`` is where those points lie on the
meshes. They differ: the detector's depth is that of its own idea of a face, and leans.
Both are averaged, mirrored and levelled. About a minute.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
from scipy.optimize import linear_sum_assignment

from generator.dataset.format.anchors_table import read_anchors
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, graphics_rotation, rotation_from_angles
from generator.landmarks.topology import FACE_MESH

TARGET = Path(__file__).resolve().parents[1] / "generator" / "landmarks"
EYE_DISTANCE_MM = 90.0

LEVEL_PITCH_DEG = 0.76
"""Pitch from the parametric heads' pose zero to that of MediaPipe's canonical face model.

Measured once, by the rigid fit of the surface face to 116 well-spread published vertices of that
model (rms 6.4 mm); its standard deviation over resampled heads is 0.6 degrees. Yaw and roll are
zero by symmetry. Only this number is ours to keep: no coordinate of the model is used or stored.
"""


def measured_faces() -> tuple[np.ndarray, np.ndarray]:
    """Landmarks turned back to pose zero, and anchors: frame U, one face a row, [N, 468, 3] each."""
    with tempfile.TemporaryDirectory() as folder:
        build = "build --count 24 --seed 2024 --images none --resolution 384 --lens 200 --samples 2"
        grid = ["--yaw=-15,15,15", "--pitch=-15,15,15", "--roll=0,0,10"]
        command = [sys.executable, "-m", "generator.cli", *build.split(), *grid, "--out", f"{folder}/d"]
        subprocess.run(command, check=True)
        columns = ["subject", "rotation", "detected", "landmarks"]
        table = pq.read_table(f"{folder}/d/data", columns=columns, partitioning=None)
        anchors = [a.points for a in read_anchors(Path(folder) / "d").values()]
    seen = table.filter(table["detected"])
    rotations = np.stack(seen["rotation"].to_numpy()).reshape(-1, 3, 3)
    landmarks = np.stack(seen["landmarks"].to_numpy()).reshape(-1, FACE_MESH.count, 3).astype(np.float64)
    return landmarks @ rotations @ CAMERA_FROM_GRAPHICS, np.stack(anchors) @ CAMERA_FROM_GRAPHICS


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


def write(name: str, faces: np.ndarray, pairs: np.ndarray | None) -> np.ndarray:
    """Average, mirror, level and write one face; returns its mirror pairs."""
    face = mean_face(faces)
    pairs = mirror_pairs(face) if pairs is None else pairs
    face -= face.mean(0)
    face = (face + face[pairs] * [-1.0, 1.0, 1.0]) / 2
    face *= EYE_DISTANCE_MM / np.linalg.norm(face[FACE_MESH.left_eye_outer] - face[FACE_MESH.right_eye_outer])
    level = graphics_rotation(rotation_from_angles(np.array([0.0, LEVEL_PITCH_DEG, 0.0])))
    face = (face - face.mean(0)) @ level.T
    header = "x,y,z of the points in mm, frame U; made by scripts/make_reference_face.py"
    np.savetxt(TARGET / name, face, fmt="%.2f", delimiter=",", header=header)
    print(f"{name}: {len(face)} points, {np.ptp(face, axis=0).round(1)} mm")
    return pairs


def main() -> None:
    """Measure and write the two files."""
    detected, anchored = measured_faces()
    pairs = write("reference_face.csv", detected, None)
    write("surface_face.csv", anchored[np.isfinite(anchored).all(axis=(1, 2))], pairs)


if __name__ == "__main__":
    main()
