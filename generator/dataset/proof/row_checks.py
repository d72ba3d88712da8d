# SPDX-License-Identifier: GPL-3.0-or-later
"""What must hold on every row: identity, rotation, camera, landmarks, image."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from generator.dataset.format.columns import FURTHER, LOOKS, ROWS, SCHEMA_VERSION, columns_at
from generator.dataset.format.files import file_sha256
from generator.dataset.format.guard import dataset_file
from generator.dataset.format.open import as_array
from generator.dataset.format.schema import image_path, sample_id
from generator.dataset.proof.context import RowContext
from generator.dataset.proof.exact_checks import exact_problems
from generator.dataset.proof.named import named
from generator.dataset.proof.pass_checks import pass_problems
from generator.errors import DatasetError
from generator.geometry.rotation import quaternion_from_rotation, rotation_from_angles
from generator.plan.factors import part_folder, row_name
from generator.plan.poses import ANGLES

TOLERANCE, CAMERA_TOLERANCE = 1e-12, 1e-9
Problems = Iterator[str]
RowCheck = Callable[[pa.RecordBatch, RowContext], Iterable[str]]


def identity_problems(batch: pa.RecordBatch, context: RowContext) -> Problems:
    """Name, split, licence and place in the grid, against heads.parquet and poses.csv."""
    assert context.poses is not None
    facts = (batch.column(n).to_pylist() for n in ("sample_id", "split", "head_license", "redistributable"))
    indices = np.stack([as_array(batch, f"{angle}_index") for angle in ANGLES], axis=-1)
    folder = part_folder(context.factor)
    off = (indices != context.poses.indices(context.head_index, context.pose_index)).any(axis=1)
    places = (context.head_index.tolist(), context.pose_index.tolist())
    for name, row_split, license_, redistributable, i, k, off_grid in zip(
        *facts, *places, off.tolist(), strict=True
    ):
        head = context.heads[i]
        pose = row_name(context.poses.name(i, k), context.factor)
        expected = sample_id(head.subject, head.expression, pose)
        if name != expected:
            yield f"{name} should be called {expected}"
        if row_split != context.split or head.split != context.split:
            yield f"{name}: split {row_split!r} in {folder}/{context.split}, {head.split!r} in heads.parquet"
        if license_ != head.license or redistributable != head.redistributable:
            yield f"{name}: licence differs from heads.parquet ({license_!r}, {head.license!r})"
        if off_grid:
            yield f"{name}: place in the grid differs from poses.csv"


def rotation_problems(batch: pa.RecordBatch, _: RowContext) -> Problems:
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


def camera_problems(batch: pa.RecordBatch, context: RowContext) -> Problems:
    """Size, K, translation and projection against the camera that the row has to have."""
    places = zip(context.head_index.tolist(), context.pose_index.tolist(), strict=True)
    cameras = [context.expected_view(head, pose).camera for head, pose in places]
    facts = {
        camera: (camera.matrix.reshape(-1), camera.translation_mm, [camera.width, camera.height])
        for camera in dict.fromkeys(cameras)
    }
    matrices, offsets, sizes = (np.stack(v) for v in zip(*(facts[c] for c in cameras), strict=True))
    off = (as_array(batch, "width") != sizes[:, 0]) | (as_array(batch, "height") != sizes[:, 1])
    yield from named(batch, off, "width or height is not that of the camera's image")
    for name, expected in (("camera", matrices), ("translation_mm", offsets)):
        wrong = _far(as_array(batch, name), expected, CAMERA_TOLERANCE)
        yield from named(batch, wrong, f"{name} is not what the configuration plans")
    projections = batch.column("projection").to_pylist()
    wrong = np.array([p != camera.projection for p, camera in zip(projections, cameras, strict=True)])
    yield from named(batch, wrong, "projection is not what the configuration plans")


def look_problems(batch: pa.RecordBatch, context: RowContext) -> Problems:
    """Every draw of the look against the one that the configuration, its seed and the row's name give."""
    places = zip(context.head_index.tolist(), context.pose_index.tolist(), strict=True)
    looks = [context.expected_view(head, pose).look for head, pose in places]
    for name, key in LOOKS.items():
        expected = np.array([getattr(look, key) for look in looks])
        if expected.dtype.kind == "U":
            said = np.array(batch.column(name).to_pylist())
            unsaid = said == ""
        else:
            said = as_array(batch, name)
            unsaid = np.isnan(said)
        if not unsaid.all():  # as in parts that are older than the column
            wrong = (said != expected).reshape(len(said), -1).any(axis=1)
            yield from named(batch, wrong, f"{name} is not what the configuration plans")


def landmark_problems(batch: pa.RecordBatch, _: RowContext) -> Problems:
    """Finite where detected, all NaN where not; those of further detectors one or the other."""
    detected = as_array(batch, "detected").astype(bool)
    finite, missing = _all_or_none(batch, "landmarks")
    yield from named(batch, detected & ~finite, "detected, but a landmark is not finite")
    yield from named(batch, ~detected & ~missing, "not detected, but a landmark is not NaN")
    for name in (name for name in batch.schema.names if name in FURTHER):
        finite, missing = _all_or_none(batch, name)
        yield from named(batch, ~finite & ~missing, f"some of {name} are NaN and some are not")


def _all_or_none(batch: pa.RecordBatch, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Rows whose landmarks are all finite, and all NaN. bool [N] each."""
    landmarks = as_array(batch, name)
    return np.isfinite(landmarks).all(axis=(1, 2)), np.isnan(landmarks).all(axis=(1, 2))


def image_problems(batch: pa.RecordBatch, context: RowContext) -> Problems:
    """Every image is there and its SHA-256 is the row's."""
    mode, root = context.images, context.root
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
                actual = file_sha256(dataset_file(root, path))
            except DatasetError as error:
                yield str(error)
                continue
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


ROW_CHECKS: Mapping[str, RowCheck] = {
    "identity": identity_problems,
    "rotation": rotation_problems,
    "camera": camera_problems,
    "look": look_problems,
    "landmarks": landmark_problems,
    "exact landmarks": exact_problems,
    "images": image_problems,
    "passes": pass_problems,
}
"""What is proved of rows, each over several columns, which name it."""


def row_checks(schema_version: str = SCHEMA_VERSION) -> dict[str, RowCheck]:
    """The checks of the rows of a dataset of this schema version: those its columns name, in the order
    above, and then those that belong to one column, by its name."""
    columns = columns_at(ROWS, schema_version)
    wanted = {column.check for column in columns}
    own: dict[str, Any] = {column.name: column.check for column in columns if callable(column.check)}
    return {name: check for name, check in ROW_CHECKS.items() if name in wanted} | own
