# SPDX-License-Identifier: GPL-3.0-or-later
"""The columns of a dataset's rows: each one once, with everything that is to be known about it.

Schema, writer, readers of older data, verify, replay, the dataset card, exports and docs/table.md
follow from :data:`ROWS`. The columns of heads.parquet are the fields of
:class:`generator.dataset.format.heads_table.HeadRow`.
"""

from __future__ import annotations

import re
from collections import ChainMap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import pyarrow as pa

from generator.landmarks.topology import Topology
from generator.plan.settings import Look, section_settings
from generator.registries import DETECTORS

if TYPE_CHECKING:
    from generator.dataset.format.unit_rows import UnitRows

SCHEMA_VERSION = "1.5.0"
"""A new column raises the middle number, and says so in its ``since``; readers of the old one go on."""

ImageMode = Literal["none", "files", "embedded"]
"""Where the images are: nowhere (only their hash), under images/, or in the table itself."""

IMAGE_MODES: tuple[ImageMode, ...] = get_args(ImageMode)

NUMPY_TYPES = {pa.float64(): np.float64, pa.float32(): np.float32, pa.bool_(): np.bool_}
"""Of list elements. (pyarrow's own mapping needs pandas, which a build does not.)"""


@dataclass(frozen=True)
class PerPoint:
    """The type of a list with so many values for each of a topology's landmarks."""

    kind: pa.DataType
    values: int = 1


@dataclass(frozen=True)
class Compare:
    """How replay compares what a row holds with what came out again.

    kind: "exact"; "floats" (NaN equals NaN; the largest difference is told in unit); "flags" (those
        that differ are counted). Of a file's hash the file itself is compared too, where there is one.
    says: the line about a difference; {name}, {then} and {now} are filled in.
    """

    kind: Literal["exact", "floats", "flags"] = "exact"
    unit: str = ""
    says: str = "{name} differs"


@dataclass(frozen=True)
class Column:
    """One column.

    name, type, meaning: as the schema and the documentation have them; meaning is one line.
    check: what of verify proves it: the name of one of
        :data:`generator.dataset.proof.row_checks.ROW_CHECKS` or of the checks of whole files, or a
        function (batch, :class:`generator.dataset.proof.context.RowContext`) -> problems, which
        then stands in the report under the column's name.
    fill: UnitRows -> N values. None takes them from ``UnitRows.extra``, or the head's field.
    replay: how replay compares it; None: not at all.
    since: the schema version it came in.
    default: what it holds where there is nothing to say, for every element of a list: in datasets
        of another image mode, and for a reader of an older dataset that lacks it.
    images: only datasets with images of this mode have values. Without a default the others
        do not have the column.
    guard: the text becomes the name of a file ("name"), or is names joined by "/" ("path", which may be
        empty where that is the default): see :mod:`generator.dataset.format.guard`.
    local: points at files of the dataset's folder, which do not travel with an export of the table.
    nullable: as declared only; verify proves that there are no nulls.
    """

    name: str
    type: pa.DataType | PerPoint
    meaning: str
    check: str | Callable[[pa.RecordBatch, Any], Iterable[str]]
    fill: Callable[[UnitRows], Any] | None = None
    replay: Compare | None = None
    since: str = "1.0.0"
    default: Any = None
    images: ImageMode | None = None
    guard: Literal["name", "path"] | None = None
    local: bool = False
    nullable: bool = False

    def arrow_type(self, topology: Topology) -> pa.DataType:
        """Its type in a dataset of these landmarks."""
        if isinstance(self.type, PerPoint):
            return list_of(self.type.kind, topology.count * self.type.values)
        return self.type

    def field(self, topology: Topology) -> pa.Field:
        """Its field in a schema."""
        return pa.field(self.name, self.arrow_type(topology), nullable=self.nullable)

    def of_rows(self, rows: UnitRows, images: ImageMode) -> pa.Array:
        """Its values in the table of one unit."""
        kind = self.arrow_type(rows.topology)
        if self.images not in (None, images):
            return self.absent(len(rows), kind)
        return to_arrow(self.fill(rows) if self.fill else rows.extra[self.name], kind)

    def absent(self, count: int, kind: pa.DataType) -> pa.Array:
        """Its default, count times."""
        if pa.types.is_fixed_size_list(kind):
            return to_arrow(np.full((count, kind.list_size), self.default), kind)
        return pa.array([self.default] * count, type=kind)

    @property
    def values_a_point(self) -> int:
        """Of a landmark; 0 where it is not about landmarks."""
        return self.type.values if isinstance(self.type, PerPoint) else 0

    def is_in(self, images: ImageMode) -> bool:
        """Do datasets with images of this mode have the column?"""
        return self.images in (None, images) or self.default is not None


def list_of(kind: pa.DataType, size: int = -1) -> pa.DataType:
    """A list of so many elements, none of them null; -1: of any number."""
    return pa.list_(pa.field("element", kind, nullable=False), size)


def to_arrow(values: Any, kind: pa.DataType) -> pa.Array:
    """Values as a column. Lists of fixed size from an array [N, ...] of as many numbers a row."""
    if not pa.types.is_fixed_size_list(kind):
        return pa.array(values, type=kind)
    flat = np.ascontiguousarray(values, dtype=NUMPY_TYPES[kind.value_type]).reshape(-1)
    return pa.FixedSizeListArray.from_arrays(pa.array(flat), type=kind)


def version_number(version: str) -> tuple[int, int, int] | None:
    """ "1.1.0" as (1, 1, 0); None if it is no version."""
    found = re.fullmatch(r"(\d{1,6})\.(\d{1,6})\.(\d{1,6})", version)
    return (int(found[1]), int(found[2]), int(found[3])) if found else None


def columns_at(table: Mapping[str, Column], version: str) -> list[Column]:
    """The columns that a dataset of this schema version has, as far as we know them."""
    number = version_number(version) or (0, 0, 0)
    return [column for column in table.values() if (version_number(column.since) or (0, 0, 0)) <= number]


LOOKS = {f"look_{one.key}": one.key for one in section_settings("look", Look) if one.info.varies}
"""Columns of what an image looks like, and the field of the look that each one holds."""


def _look_column(name: str, key: str) -> Column:
    """What was drawn for each image, or set for all."""
    [known] = [one for one in section_settings("look", Look) if one.key == key]
    unit = f", {known.info.unit}" if known.info.unit else ""
    meaning = f"{known.info.help[0].lower()}{known.info.help[1:]}{unit}"
    of_texts, several = known.kind is str, len(get_args(known.kind))
    numbers = list_of(pa.float64(), several) if several else pa.float64()
    return Column(
        name,
        pa.string() if of_texts else numbers,
        meaning,
        "look",
        lambda rows: rows.of_looks(lambda look: getattr(look, key)),
        Compare() if of_texts else Compare("floats"),
        since=known.info.since,
        default="" if of_texts else float("nan"),
    )


def _row_columns() -> tuple[Column, ...]:
    text, number, index = pa.string(), pa.float64(), pa.int16()
    same, placed, image = Compare(), "every row once", "images"
    return (
        Column("sample_id", text, "subject/expression/pose, such as p0003/neutral/y+30_p-10_r+0; unique",
               "identity", lambda rows: rows.sample_ids, guard="path"),
        Column("subject", text, "the person", placed, lambda rows: [rows.subject] * len(rows),
               guard="name"),
        Column("expression", text, "the expression, such as neutral", placed,
               lambda rows: [rows.expression] * len(rows), guard="name"),
        Column("split", text, "train or validation: by subject, never by image", "identity",
               lambda rows: [rows.split] * len(rows), guard="name"),
        Column("head_license", text, "the head's own licence", "identity",
               lambda rows: [rows.head_license] * len(rows)),
        Column("redistributable", pa.bool_(), "may renders of the head be published?", "identity",
               lambda rows: [rows.redistributable] * len(rows)),
        Column("yaw_deg", number, "requested angle, degrees, exact; > 0: nose to image left", placed,
               lambda rows: rows.angles_deg[:, 0]),
        Column("pitch_deg", number, "requested angle, degrees, exact; > 0: nose up", placed,
               lambda rows: rows.angles_deg[:, 1]),
        Column("roll_deg", number, "requested angle, degrees, exact; > 0: crown to image right", placed,
               lambda rows: rows.angles_deg[:, 2]),
        Column("yaw_index", index, "place in the grid, -1 off the grid", "identity",
               lambda rows: rows.indices[:, 0]),
        Column("pitch_index", index, "place in the grid, -1 off the grid", "identity",
               lambda rows: rows.indices[:, 1]),
        Column("roll_index", index, "place in the grid, -1 off the grid", "identity",
               lambda rows: rows.indices[:, 2]),
        Column("rotation", list_of(number, 9), "R_C, row-major: the truth", "rotation",
               lambda rows: rows.rotation, same),
        Column("quaternion", list_of(number, 4), "w, x, y, z of R_C, w >= 0", "rotation",
               lambda rows: rows.quaternion),
        Column("camera", list_of(number, 9), "K, row-major, pixels", "camera",
               lambda rows: rows.of_cameras(lambda camera: camera.matrix), same),
        Column("translation_mm", list_of(number, 3), "the head's pivot in frame C, mm; [2] is the distance",
               "camera", lambda rows: rows.of_cameras(lambda camera: camera.translation_mm), same),
        Column("projection", text, "perspective or orthographic", "camera",
               lambda rows: rows.of_cameras(lambda camera: camera.projection), same,
               since="1.1.0", default="perspective"),
        *(_look_column(name, key) for name, key in LOOKS.items()),
        Column("look_left_out", text, "what of the look could not be made, and why; empty where all was",
               "look", lambda rows: rows.looks_left_out, same, since="1.3.0", default=""),
        Column("detected", pa.bool_(), "did the detector find the face?", "landmarks",
               lambda rows: rows.detected, Compare(says="detected was {then}, is {now}")),
        Column("landmarks", PerPoint(pa.float32(), 3),
               "x, y, z of each landmark, isotropic pixels, frame C; NaN where not detected", "landmarks",
               lambda rows: rows.landmarks, Compare("floats", "px")),
        Column("landmarks_exact", PerPoint(pa.float32(), 3),
               "x, y, z of the same points on the mesh, R_C X + t, frame C, mm; NaN without an anchor",
               "exact landmarks", lambda rows: rows.landmarks_exact, Compare("floats", "mm"),
               since="1.1.0", default=float("nan")),
        Column("landmarks_visible", PerPoint(pa.bool_()),
               "is each exact landmark in the image, with nothing in front of it?", "exact landmarks",
               lambda rows: rows.visible, Compare("flags"), since="1.1.0", default=False),
        Column("width", pa.int32(), "of the image, pixels", "camera",
               lambda rows: rows.of_cameras(lambda camera: camera.width), same),
        Column("height", pa.int32(), "of the image, pixels", "camera",
               lambda rows: rows.of_cameras(lambda camera: camera.height), same),
        Column("image_path", text, "of the image file, relative to the dataset; else empty", image,
               lambda rows: rows.image_paths, default="", images="files", guard="path", local=True),
        Column("image_sha256", text, "of the image file's bytes, also where images are not stored", image,
               lambda rows: rows.image_hashes, Compare(says="the image differs")),
        Column("passes_path", text, "OpenEXR of the passes, relative to the dataset; empty without passes",
               "passes", lambda rows: rows.passes_paths, since="1.1.0", default="", guard="path", local=True),
        Column("passes_sha256", text, "of the floats of the passes; empty without passes", "passes",
               lambda rows: rows.passes_hashes, Compare(says="the floats of the passes differ"),
               since="1.1.0", default="", guard="path", local=True),
        # Nullable by declaration only: Hugging Face datasets takes a struct for an image only if its
        # fields may be null.
        Column("image", pa.struct([("bytes", pa.binary()), ("path", text)]),
               "the encoded image and its name; only with images = embedded", image,
               lambda rows: rows.embedded_images, images="embedded", nullable=True),
    )  # fmt: skip


ROWS: dict[str, Column] = {column.name: column for column in _row_columns()}
"""Every column of the rows by its name, in the order of the table."""

TWINS: dict[str, Column] = {
    column.name: column
    for column in (
        Column("twin_of", pa.string(), "sample_id of the row of which it is the twin", "identity",
               lambda rows: rows.base_ids, since="1.3.0", guard="path"),
        Column("factor", pa.string(), "what differs from that row, such as light", "identity",
               lambda rows: [rows.factor] * len(rows), since="1.3.0", guard="name"),
    )
}  # fmt: skip
"""What a table of twins has besides, by name."""


def further_column(detector: str) -> str:
    """The column of a further detector."""
    return f"landmarks_{detector}"


FURTHER: dict[str, Column] = {
    further_column(name): Column(
        further_column(name), PerPoint(pa.float32(), 3),
        f"landmarks as the further detector {name} finds them; NaN where it finds no face", "landmarks",
        replay=Compare("floats", "px"), since="1.4.0",
    )
    for name in DETECTORS
}  # fmt: skip
"""What a table has besides where further detectors looked at its images, by name; see
:mod:`generator.dataset.format.further`."""

EVERY: Mapping[str, Column] = ChainMap(ROWS, TWINS, FURTHER)
"""The columns of all."""
