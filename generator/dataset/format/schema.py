# SPDX-License-Identifier: GPL-3.0-or-later
"""The table's columns and the facts every part carries in its schema metadata."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Literal, get_args

import pyarrow as pa

from generator.errors import DatasetError

SCHEMA_VERSION = "1.1.0"
LANDMARK_TOPOLOGY = "mediapipe-face-mesh-468"
LANDMARKS = 468

ImageMode = Literal["none", "files", "embedded"]
"""Where the images are: nowhere (only their hash), under images/, or in the table itself."""

IMAGE_MODES: tuple[ImageMode, ...] = get_args(ImageMode)

CONVENTIONS = {
    "frame": "C (camera): x image-right, y image-down, z into the scene; right-handed",
    "rotation": "R_C = Rx(-pitch) Ry(yaw) Rz(roll), row-major; active, on column vectors, intrinsic X-Y-Z",
    "angles": "yaw, pitch, roll in degrees",
    "signs": "yaw > 0: nose to image left; pitch > 0: nose up; roll > 0: crown to image right",
    "quaternion": "w, x, y, z of R_C with w >= 0",
    "camera": "K, row-major, pixels; the centre of the first pixel is (0.5, 0.5)",
    "translation": "the pivot of the rotation in frame C, mm",
    "landmarks": "468 x (x, y, z) in isotropic pixels, frame C; NaN where detected is false",
    "landmarks_exact": "the same points on the mesh, R_C X + t, frame C, mm; NaN where a head has no anchor",
    "landmarks_visible": "is the exact landmark inside the image and nothing of the head in front of it?",
    "projection": "of (X, Y, Z) in frame C: perspective K (X/Z, Y/Z, 1); orthographic K (X/t_z, Y/t_z, 1)",
}


def _list(kind: pa.DataType, size: int) -> pa.DataType:
    return pa.list_(pa.field("element", kind, nullable=False), size)


_COLUMNS: tuple[tuple[str, pa.DataType], ...] = (
    ("sample_id", pa.string()),
    ("subject", pa.string()),
    ("expression", pa.string()),
    ("split", pa.string()),
    ("head_license", pa.string()),
    ("redistributable", pa.bool_()),
    ("yaw_deg", pa.float64()),
    ("pitch_deg", pa.float64()),
    ("roll_deg", pa.float64()),
    ("yaw_index", pa.int16()),
    ("pitch_index", pa.int16()),
    ("roll_index", pa.int16()),
    ("rotation", _list(pa.float64(), 9)),
    ("quaternion", _list(pa.float64(), 4)),
    ("camera", _list(pa.float64(), 9)),
    ("translation_mm", _list(pa.float64(), 3)),
    ("projection", pa.string()),
    ("detected", pa.bool_()),
    ("landmarks", _list(pa.float32(), LANDMARKS * 3)),
    ("landmarks_exact", _list(pa.float32(), LANDMARKS * 3)),
    ("landmarks_visible", _list(pa.bool_(), LANDMARKS)),
    ("width", pa.int32()),
    ("height", pa.int32()),
    ("image_path", pa.string()),
    ("image_sha256", pa.string()),
    ("passes_path", pa.string()),
    ("passes_sha256", pa.string()),
)

# Nullable by declaration only (verify proves there are none): Hugging Face
# datasets takes a struct for an image only if its fields may be null.
IMAGE_FIELD = pa.field("image", pa.struct([("bytes", pa.binary()), ("path", pa.string())]))

LANDMARK_COLUMNS = ("landmarks", "landmarks_exact")
"""Columns of incompressible floats, stored with BYTE_STREAM_SPLIT."""


def part_schema(images: ImageMode, versions: Mapping[str, str], configuration_digest: str) -> pa.Schema:
    """Schema of one part: columns in order, none nullable, and the metadata.

    versions: name and version of every package that decides the content.
    configuration_digest: of :func:`generator.plan.first_settings.common_values`.
    """
    fields = [pa.field(name, kind, nullable=False) for name, kind in _COLUMNS]
    metadata = {
        "headturn.schema_version": SCHEMA_VERSION,
        "headturn.conventions": _json(CONVENTIONS),
        "headturn.landmark_topology": LANDMARK_TOPOLOGY,
        "headturn.images": images,
        "headturn.versions": _json(versions),
        "headturn.configuration_digest": configuration_digest,
    }
    if images == "embedded":
        fields.append(IMAGE_FIELD)
        metadata["huggingface"] = _json({"info": {"features": {"image": {"_type": "Image"}}}})
    return pa.schema(fields, metadata=metadata)


def image_mode(schema: pa.Schema) -> str:
    """Where the images are, from the metadata :func:`part_schema` wrote."""
    return schema.metadata[b"headturn.images"].decode()


def versions_of(schema: pa.Schema) -> dict[str, str]:
    """Versions of everything that decided the content of a part, from its metadata."""
    versions: dict[str, str] = json.loads((schema.metadata or {}).get(b"headturn.versions", b"{}"))
    return versions


def check_schema_version(version: str, where: str) -> None:
    """Raises DatasetError unless this program reads that version (same major and minor number)."""
    expected = SCHEMA_VERSION.rpartition(".")[0]
    if version.rpartition(".")[0] != expected:
        raise DatasetError(
            f"{where}: schema version {version!r}, expected {expected}.x; build it again from its "
            "config.toml into another folder, or read it with the version of Headturn that wrote it"
        )


def check_name(what: str, name: str) -> None:
    """Raises DatasetError unless name can be a folder and a part of a sample_id on every system."""
    if not re.fullmatch(r"\w([\w .+-]*[\w+-])?", name):
        raise DatasetError(
            f"{what} {name!r} cannot be used as a name; "
            "use letters, digits, '_', '-', '+', '.' and inner spaces"
        )


def sample_id(subject: str, expression: str, pose: str) -> str:
    """The name of one row, unique in a dataset. pose: :func:`generator.plan.poses.pose_name`."""
    return f"{subject}/{expression}/{pose}"


def image_path(subject: str, expression: str, pose: str, suffix: str) -> str:
    """Where an image is stored with images = "files", relative to the dataset. suffix: ".png"."""
    return f"images/{subject}/{expression}/{pose}{suffix}"


def passes_path(subject: str, expression: str, pose: str) -> str:
    """Where the passes of an image are stored, relative to the dataset."""
    return f"exr/{subject}/{expression}/{pose}.exr"


def _json(value: object) -> str:
    return json.dumps(value, sort_keys=True, ensure_ascii=False)
