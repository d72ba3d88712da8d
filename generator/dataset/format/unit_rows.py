# SPDX-License-Identifier: GPL-3.0-or-later
"""What rendering and detecting one unit of work gives, and the table it becomes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, cast

import numpy as np
import pyarrow as pa

from generator.dataset.format.columns import EVERY, ImageMode
from generator.dataset.format.schema import (
    check_name,
    image_mode,
    image_path,
    passes_path,
    sample_id,
    topology_of,
)
from generator.geometry.camera import Camera
from generator.geometry.rotation import quaternion_from_rotation, rotation_from_angles
from generator.landmarks.topology import FACE_MESH, Topology
from generator.plan.factors import row_name
from generator.plan.poses import pose_name
from generator.plan.settings import Look


@dataclass(frozen=True, eq=False)
class UnitRows:
    """One head, N poses, P landmarks.

    angles_deg     float64 [N, 3] (yaw, pitch, roll); indices int16 [N, 3]: rows of a PosePlan
    cameras, looks one for all rows, or N
    detected       bool [N]
    landmarks      float32 [N, P, 3], isotropic pixels, frame C; NaN where not detected
    anchors        float64 [P, 3], the points on the mesh at pose zero, frame C, mm, pivot at
                   the origin; NaN where the head has none
    visible        bool [N, P], False where there is no anchor
    images         N encoded image files; image_suffix is theirs, such as ".png"
    passes         N multilayer OpenEXR files and the SHA-256 of their decoded floats; None
                   where no passes were asked for
    topology       what the P landmarks are
    factor         the rows are twins, with this one changed
    left_out       of each row, what its head could not wear and why; empty where nothing was
    extra          values of columns that have no ``fill`` of their own: name -> [N, ...]
    """

    subject: str
    expression: str
    split: str
    head_license: str
    redistributable: bool
    angles_deg: np.ndarray
    indices: np.ndarray
    cameras: tuple[Camera, ...]
    looks: tuple[Look, ...]
    detected: np.ndarray
    landmarks: np.ndarray
    anchors: np.ndarray
    visible: np.ndarray
    images: Sequence[bytes]
    image_suffix: str = ".png"
    passes: Sequence[tuple[bytes, str]] | None = None
    topology: Topology = FACE_MESH
    factor: str = ""
    left_out: Sequence[str] = ()
    extra: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        count, points = len(self.angles_deg), self.topology.count
        shapes = {
            "angles_deg": (self.angles_deg.shape, (count, 3)),
            "indices": (self.indices.shape, (count, 3)),
            "detected": (self.detected.shape, (count,)),
            "landmarks": (self.landmarks.shape, (count, points, 3)),
            "anchors": (self.anchors.shape, (points, 3)),
            "visible": (self.visible.shape, (count, points)),
            "images": ((len(self.images),), (count,)),
        }
        for name, (actual, expected) in shapes.items():
            if actual != expected:
                raise ValueError(f"{name}: expected shape {expected}, got {actual}")
        for name in ("cameras", "looks"):
            if len(getattr(self, name)) not in (1, count):
                raise ValueError(f"{name}: expected 1 or {count}, got {len(getattr(self, name))}")
        finite = np.isfinite(self.landmarks).all(axis=(1, 2))
        missing = np.isnan(self.landmarks).all(axis=(1, 2))
        if not np.where(self.detected, finite, missing).all():
            raise ValueError("landmarks must be finite where detected and all NaN where not")
        anchored = np.isfinite(self.anchors).all(axis=1)
        if not np.where(anchored, True, np.isnan(self.anchors).all(axis=1)).all():
            raise ValueError("an anchor must be finite or all NaN")
        if self.visible[:, ~anchored].any():
            raise ValueError("a point without an anchor cannot be visible")
        if self.passes is not None and len(self.passes) != count:
            raise ValueError(f"passes: expected {count}, got {len(self.passes)}")
        for what in ("subject", "expression", "split", *(["factor"] if self.factor else [])):
            check_name(what, getattr(self, what))

    def __len__(self) -> int:
        return len(self.angles_deg)

    @cached_property
    def poses(self) -> list[str]:
        """The name of each pose, and of the factor of twins."""
        return [row_name(pose_name(*angles), self.factor) for angles in self.angles_deg.tolist()]

    @property
    def sample_ids(self) -> list[str]:
        """The name of each row."""
        return [sample_id(self.subject, self.expression, pose) for pose in self.poses]

    @property
    def base_ids(self) -> list[str]:
        """The name of the row of which each is the twin."""
        poses = (pose_name(*angles) for angles in self.angles_deg.tolist())
        return [sample_id(self.subject, self.expression, pose) for pose in poses]

    def of_cameras(self, value: Callable[[Camera], Any]) -> list[Any]:
        """What value says of each row's camera."""
        values = [value(camera) for camera in self.cameras]
        return values if len(values) == len(self) else values * len(self)

    def of_looks(self, value: Callable[[Look], Any]) -> list[Any]:
        """What value says of each row's look."""
        values = [value(look) for look in self.looks]
        return values if len(values) == len(self) else values * len(self)

    @property
    def looks_left_out(self) -> list[str]:
        """What of each row's look could not be made; "" where all of it was."""
        return [*self.left_out] or [""] * len(self)

    @property
    def image_paths(self) -> list[str]:
        """Where each image is stored with images = "files", relative to the dataset."""
        return [image_path(self.subject, self.expression, pose, self.image_suffix) for pose in self.poses]

    @property
    def image_hashes(self) -> list[str]:
        """SHA-256 of each image file."""
        return [hashlib.sha256(image).hexdigest() for image in self.images]

    @property
    def embedded_images(self) -> list[dict[str, Any]]:
        """Each image as the table holds it with images = "embedded"."""
        names = [path.rpartition("/")[2] for path in self.image_paths]
        return [{"bytes": b, "path": n} for b, n in zip(self.images, names, strict=True)]

    @property
    def passes_paths(self) -> list[str]:
        """Where the passes of each image are stored, relative to the dataset; "" without passes."""
        if self.passes is None:
            return [""] * len(self)
        return [passes_path(self.subject, self.expression, pose) for pose in self.poses]

    @property
    def passes_hashes(self) -> list[str]:
        """SHA-256 of each row's passes; "" without."""
        return [digest for _, digest in self.passes] if self.passes else [""] * len(self)

    @cached_property
    def rotation(self) -> np.ndarray:
        """R_C, float64 [N, 3, 3]."""
        return rotation_from_angles(self.angles_deg)

    @property
    def quaternion(self) -> np.ndarray:
        """w, x, y, z of R_C, float64 [N, 4]."""
        return quaternion_from_rotation(self.rotation)

    @property
    def landmarks_exact(self) -> np.ndarray:
        """R_C X + t of the anchors X, float32 [N, P, 3], frame C, mm."""
        shift = np.array([camera.translation_mm for camera in self.cameras])
        points = self.anchors @ np.swapaxes(self.rotation, -1, -2) + shift[:, None]
        return points.astype(np.float32)


def unit_table(rows: UnitRows, schema: pa.Schema) -> pa.Table:
    """The table of one unit, in the order of rows. schema: see ``part_schema`` of the schema module."""
    if topology_of(schema) is not rows.topology:
        raise ValueError(f"the rows have the landmarks {rows.topology.name}, the schema has others")
    mode = cast(ImageMode, image_mode(schema))
    return pa.table([EVERY[field.name].of_rows(rows, mode) for field in schema], schema=schema)
