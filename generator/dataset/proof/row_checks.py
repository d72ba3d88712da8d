# SPDX-License-Identifier: GPL-3.0-or-later
"""What must hold on every row: identity, rotation, camera, landmarks, image."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa

from generator.dataset.format.files import file_sha256
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.open import as_array
from generator.dataset.format.schema import ImageMode, image_path, sample_id
from generator.geometry.rotation import quaternion_from_rotation, rotation_from_angles
from generator.plan.poses import ANGLES, PosePlan

TOLERANCE = 1e-12
Problems = Iterator[str]


def identity_problems(
    batch: pa.RecordBatch,
    heads: Sequence[HeadRow],
    plan: PosePlan,
    names: Sequence[str],
    head_index: np.ndarray,
    pose_index: np.ndarray,
    split: str,
) -> Problems:
    """Name, split, licence and place in the grid, against heads.parquet and poses.csv.

    names: of the plan's poses. head_index, pose_index: int [N], place of each row, none below 0.
    split: the folder the part lies in.
    """
    facts = (batch.column(n).to_pylist() for n in ("sample_id", "split", "head_license", "redistributable"))
    indices = np.stack([as_array(batch, f"{angle}_index") for angle in ANGLES], axis=-1)
    off = (indices != plan.indices[pose_index]).any(axis=1)
    rows = zip(*facts, head_index.tolist(), pose_index.tolist(), off.tolist(), strict=True)
    for name, row_split, license_, redistributable, i, k, off_grid in rows:
        head = heads[i]
        expected = sample_id(head.subject, head.expression, names[k])
        if name != expected:
            yield f"{name} should be called {expected}"
        if row_split != split or head.split != split:
            yield f"{name}: split {row_split!r} in data/{split}, {head.split!r} in heads.parquet"
        if license_ != head.license or redistributable != head.redistributable:
            yield f"{name}: licence differs from heads.parquet ({license_!r}, {head.license!r})"
        if off_grid:
            yield f"{name}: place in the grid differs from poses.csv"


def rotation_problems(batch: pa.RecordBatch) -> Problems:
    """Matrix and quaternion against the angles, to 1e-12."""
    angles = np.stack([as_array(batch, f"{angle}_deg") for angle in ANGLES], axis=-1)
    finite = np.isfinite(angles).all(axis=1)
    expected = rotation_from_angles(np.where(finite[:, None], angles, 0.0))
    matrix = _far(as_array(batch, "rotation"), expected.reshape(-1, 9))
    quaternion = as_array(batch, "quaternion")
    exact = quaternion_from_rotation(expected)
    # At w = 0 both signs are the same rotation and w >= 0 does not choose.
    turned = _far(quaternion, exact) & _far(-quaternion, exact) | (quaternion[:, 0] < 0)
    yield from named(batch, ~finite, "an angle is not finite")
    yield from named(batch, finite & matrix, "rotation does not agree with the angles")
    yield from named(batch, finite & turned, "quaternion does not agree with the angles")


def camera_problems(batch: pa.RecordBatch, heads: Sequence[HeadRow], head_index: np.ndarray) -> Problems:
    """K, translation and projection against heads.parquet."""
    width, height = as_array(batch, "width"), as_array(batch, "height")
    pairs, pair_of_row = np.unique(np.stack([width, head_index]), axis=1, return_inverse=True)
    cameras = [heads[i].camera(size) for size, i in pairs.T.tolist()]
    matrices = np.stack([camera.matrix.reshape(-1) for camera in cameras])[pair_of_row.ravel()]
    offsets = np.stack([camera.translation_mm for camera in cameras])[pair_of_row.ravel()]
    yield from named(batch, (width != height) | (width <= 0), "not the width and height of a square image")
    for name, expected in (("camera", matrices), ("translation_mm", offsets)):
        wrong = _far(as_array(batch, name), expected, 1e-9)
        yield from named(batch, wrong, f"{name} differs from heads.parquet")
    projections = batch.column("projection").to_pylist()
    wrong = np.array([p != heads[i].projection for p, i in zip(projections, head_index, strict=True)])
    yield from named(batch, wrong, "projection differs from heads.parquet")


def landmark_problems(batch: pa.RecordBatch) -> Problems:
    """Finite where detected, all NaN where not."""
    landmarks, detected = as_array(batch, "landmarks"), as_array(batch, "detected").astype(bool)
    finite, missing = np.isfinite(landmarks).all(axis=(1, 2)), np.isnan(landmarks).all(axis=(1, 2))
    yield from named(batch, detected & ~finite, "detected, but a landmark is not finite")
    yield from named(batch, ~detected & ~missing, "not detected, but a landmark is not NaN")


def image_problems(batch: pa.RecordBatch, mode: ImageMode, root: Path) -> Problems:
    """Every image is there and its SHA-256 is the row's."""
    names = batch.column("sample_id").to_pylist()
    hashes = batch.column("image_sha256").to_pylist()
    paths = batch.column("image_path").to_pylist()
    embedded = batch.column("image") if mode == "embedded" else None
    for row, (name, sha256, path) in enumerate(zip(names, hashes, paths, strict=True)):
        if mode == "files":
            if path != image_path(*_three(name), Path(path).suffix):
                yield f"{name}: image_path {path!r} is not where its image belongs"
                continue
            try:
                actual = file_sha256(root / path)
            except OSError as error:
                yield f"{path}: {error.strerror}"
                continue
        elif path:
            yield f"{name}: image_path is {path!r} although images = {mode}"
            continue
        elif embedded is not None:
            actual = hashlib.sha256(embedded[row]["bytes"].as_buffer()).hexdigest()
        else:
            actual = sha256
        if actual != sha256 or len(sha256) != 64:
            yield f"{path or name}: the image is not the one that was rendered (SHA-256 differs)"


def _three(name: str) -> tuple[str, str, str]:
    subject, _, rest = name.partition("/")
    expression, _, pose = rest.partition("/")
    return subject, expression, pose


def _far(actual: np.ndarray, expected: np.ndarray, tolerance: float = TOLERANCE) -> np.ndarray:
    """bool [N]: rows that differ; NaN differs from everything."""
    return ~(np.abs(actual - expected) <= tolerance).all(axis=1)


def named(batch: pa.RecordBatch, wrong: np.ndarray, what: str) -> Problems:
    """One problem a row that is wrong, with its sample_id. wrong: bool [N]."""
    if wrong.any():
        names = batch.column("sample_id")
        for row in np.flatnonzero(wrong).tolist():
            yield f"{names[row].as_py()}: {what}"
