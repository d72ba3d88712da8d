# SPDX-License-Identifier: GPL-3.0-or-later
"""A part's schema: its columns and the facts every part carries in its metadata."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import pyarrow as pa

from generator.dataset.format.columns import (
    FURTHER,
    ROWS,
    SCHEMA_VERSION,
    TWINS,
    ImageMode,
    columns_at,
    further_column,
    version_number,
)
from generator.errors import DatasetError, UsageError
from generator.escape import quoted
from generator.landmarks.topology import FACE_MESH, Topology
from generator.names import name_problem
from generator.reading import parse_json
from generator.registries import TOPOLOGIES


def conventions(topology: Topology = FACE_MESH) -> dict[str, str]:
    """What the numbers of a dataset mean: name of a thing -> its definition."""
    return {
        "frame": "C (camera): x image-right, y image-down, z into the scene; right-handed",
        "rotation": "R_C = Rx(-pitch) Ry(yaw) Rz(roll), row-major; "
        "active, on column vectors, intrinsic X-Y-Z",
        "angles": "yaw, pitch, roll in degrees",
        "signs": "yaw > 0: nose to image left; pitch > 0: nose up; roll > 0: crown to image right",
        "quaternion": "w, x, y, z of R_C with w >= 0",
        "camera": "K, row-major, pixels; the centre of the first pixel is (0.5, 0.5)",
        "translation": "the pivot of the rotation in frame C, mm",
        "landmarks": f"{topology.count} x (x, y, z) in isotropic pixels, frame C; "
        "NaN where detected is false",
        "landmarks_exact": "the same points on the mesh, R_C X + t, frame C, mm; "
        "NaN where a head has no anchor",
        "landmarks_visible": "is the exact landmark inside the image and nothing of the head in front of it?",
        "projection": "of (X, Y, Z) in frame C: perspective K (X/Z, Y/Z, 1); "
        "orthographic K (X/t_z, Y/t_z, 1)",
    }


CONVENTIONS = conventions()
"""Those of Face Mesh."""


def part_schema(
    images: ImageMode,
    versions: Mapping[str, str],
    configuration_digest: str,
    topology: Topology = FACE_MESH,
    schema_version: str = SCHEMA_VERSION,
    twins: bool = False,
    also: Sequence[str] = (),
) -> pa.Schema:
    """Schema of one part: columns in order, none nullable, and the metadata.

    versions: name and version of every package that decides the content.
    configuration_digest: of :func:`generator.plan.first_settings.common_values`.
    topology: what the landmarks are. schema_version: an earlier one has only the columns of its time.
    twins: of a part of twins. also: names of further detectors.
    """
    further = {name: FURTHER[name] for name in map(further_column, also)}
    table = {**ROWS, **further, **(TWINS if twins else {})}
    columns = [column for column in columns_at(table, schema_version) if column.is_in(images)]
    metadata = {
        "headturn.schema_version": schema_version,
        "headturn.conventions": _json(conventions(topology)),
        "headturn.landmark_topology": topology.name,
        "headturn.images": images,
        "headturn.versions": _json(versions),
        "headturn.configuration_digest": configuration_digest,
    }
    if images == "embedded":
        metadata["huggingface"] = _json({"info": {"features": {"image": {"_type": "Image"}}}})
    return pa.schema([column.field(topology) for column in columns], metadata=metadata)


def image_mode(schema: pa.Schema) -> str:
    """Where the images are, from the metadata :func:`part_schema` wrote."""
    return schema.metadata[b"headturn.images"].decode()


def topology_of(schema: pa.Schema, where: str = "the schema") -> Topology:
    """What the landmarks are, from the metadata :func:`part_schema` wrote.

    where: the file, for the message. Raises DatasetError if no registered topology has that name.
    """
    name = (schema.metadata or {}).get(b"headturn.landmark_topology", b"none").decode(errors="replace")
    try:
        return TOPOLOGIES.get(name)
    except UsageError as error:
        raise DatasetError(f"{where}: {error}; read it with the Headturn that wrote it") from error


NO_VERSION = "none"


def schema_version_of(schema: pa.Schema) -> str:
    """The schema version in a part's metadata; NO_VERSION where there is none."""
    return (
        (schema.metadata or {}).get(b"headturn.schema_version", NO_VERSION.encode()).decode(errors="replace")
    )


def versions_of(schema: pa.Schema) -> dict[str, str]:
    """Versions of everything that decided the content of a part, from its metadata; none if it has none."""
    try:
        versions = parse_json((schema.metadata or {}).get(b"headturn.versions", b"{}"))
    except ValueError:
        return {}
    return {str(k): str(v) for k, v in versions.items()} if isinstance(versions, dict) else {}


def check_schema_version(version: str, where: str) -> None:
    """Raises DatasetError unless this program reads that version (same major number).

    What an earlier one lacks has a default; what a later one has besides is left alone.
    """
    number, ours = version_number(str(version)), SCHEMA_VERSION.split(".")[0]
    if number is None or str(number[0]) != ours:
        raise DatasetError(
            f"{where}: schema version {version!r}, expected {ours}.x; build it again from its "
            "config.toml into another folder, or read it with the version of Headturn that wrote it"
        )


def is_newer(version: str, than: str = SCHEMA_VERSION) -> bool:
    """Is this a later schema version, whose columns we may not all know?"""
    return (version_number(version) or (0, 0, 0)) > (version_number(than) or (0, 0, 0))


def check_name(what: str, name: str) -> None:
    """Raises DatasetError unless name can be a folder and a part of a sample_id on every system."""
    if problem := name_problem(name):
        raise DatasetError(f"{what} {quoted(name)} {problem}; choose another name")


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
