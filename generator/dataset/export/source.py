# SPDX-License-Identifier: GPL-3.0-or-later
"""The rows of a dataset that an export takes, and what it does about those that lack something."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from generator.dataset.export.boxes import face_boxes
from generator.dataset.export.options import ExportOptions, ImageFormat
from generator.dataset.export.sample import Sample, suffix_of
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.missing import Missing
from generator.dataset.format.open import IMAGE_FACTS, as_array, proven_image, read_rows
from generator.dataset.format.part_info import PartInfo
from generator.dataset.format.row_cameras import COLUMNS as CAMERA
from generator.dataset.format.row_cameras import RowCameras
from generator.errors import DatasetError, UsageError
from generator.landmarks.topology import PointSubset, Topology
from generator.plan.poses import ANGLES

_TEXT = ("sample_id", "subject", "expression", "split")
_NUMBERS = ("rotation", "detected")
_POINTS = ("landmarks", "landmarks_exact", "landmarks_visible")


@dataclass
class Source:
    """What an exporter reads. Landmarks are iBUG's 68, which is what the formats hold.

    Made by :func:`generator.dataset.export.run.export_dataset`.

    topology: what the dataset's landmarks are. heads: those that are exported.
    landmarks: "exact", "detected", or "" for formats without any.
    missing: one of the format's choices. wants_images: the format takes images. wants_boxes: and boxes.
    image_format: how they are written, where the format has a choice.
    progress: called with the number of rows read.
    rows, left_out: counted while the rows are read.
    """

    root: Path
    manifest: Manifest
    topology: Topology
    heads: list[HeadRow]
    options: ExportOptions
    landmarks: str
    missing: Missing
    wants_images: bool
    wants_boxes: bool
    image_format: ImageFormat | None
    progress: Callable[[int], None]
    rows: int = 0
    left_out: int = 0
    filled: int = 0
    _parts: list[PartInfo] = field(init=False)

    def __post_init__(self) -> None:
        chosen = {(head.subject, head.expression) for head in self.heads}
        self._parts = sorted(
            (p for p in self.manifest.parts if not p.subject or (p.subject, p.expression) in chosen),
            key=lambda part: part.path,
        )

    @property
    def points(self) -> PointSubset:
        """The points that formats with landmarks hold. Only asked where the topology has such a choice."""
        assert self.topology.ibug_68 is not None
        return self.topology.ibug_68

    @property
    def has_images(self) -> bool:
        """Are images exported?"""
        return self.wants_images and self.manifest.images != "none"

    @property
    def parts(self) -> list[PartInfo]:
        """The parts that hold exported rows, sorted by path."""
        return self._parts

    def batches(
        self, parts: list[PartInfo] | None = None, columns: list[str] | None = None
    ) -> Iterator[pa.RecordBatch]:
        """Rows batch by batch, without those that may not be published where that was asked.

        Raises DatasetError: a part is missing or damaged.
        """
        where = pc.field("redistributable") if self.options.only_redistributable else None
        for batch in read_rows(self.root, self._parts if parts is None else parts, columns, where):
            self.progress(len(batch))
            yield batch

    def kept(self, batch: pa.RecordBatch) -> pa.RecordBatch:
        """The rows of a batch that stay, when a row without a detection counts as missing.

        Raises UsageError: there are some and missing = "fail".
        """
        detected = as_array(batch, "detected").astype(bool)
        if self.missing == "keep" or detected.all():
            self.rows += len(batch)
            return batch
        if self.missing == "fail":
            self._refuse(batch.column("sample_id")[int(np.argmin(detected))].as_py(), "no face was found")
        self.left_out += int((~detected).sum())
        self.rows += int(detected.sum())
        return batch.filter(pa.array(detected))

    def samples(self) -> Iterator[Sample]:
        """Rows one by one, with points and images as the format takes them.

        Raises
        ------
        DatasetError: a part or an image is missing or damaged.
        UsageError: a row lacks its landmarks and missing = "fail".
        """
        columns = [*_TEXT, *_NUMBERS, *CAMERA, *(f"{angle}_deg" for angle in ANGLES)]
        columns += _POINTS if self.landmarks or self.wants_boxes else ()
        if self.has_images:
            columns += [*IMAGE_FACTS, *(["image"] if self.manifest.images == "embedded" else [])]
        for batch in self.batches(columns=columns):
            yield from self._samples(batch if self.landmarks else self.kept(batch))

    def _samples(self, batch: pa.RecordBatch) -> Iterator[Sample]:
        text = {name: batch.column(name).to_pylist() for name in _TEXT}
        values = {name: as_array(batch, name) for name in _NUMBERS}
        angles = np.stack([as_array(batch, f"{angle}_deg") for angle in ANGLES], axis=-1)
        cameras = RowCameras.of(batch)
        images = batch.select(IMAGE_FACTS).to_pylist() if self.has_images else None
        points, origin, visible = self._points(batch, cameras)
        boxes = face_boxes(batch, cameras) if self.wants_boxes else [None] * len(batch)
        for k in range(len(batch)):
            if self.landmarks and not self._has_points(text["sample_id"][k], origin[k]):
                continue
            image, suffix = b"", ""
            if images is not None:
                row = images[k]
                if self.manifest.images == "embedded":
                    row = {**row, "image": batch.column("image")[k].as_py()}
                image = proven_image(self.root, row, text["sample_id"][k])
                suffix = suffix_of(image, text["sample_id"][k])
            yield Sample(
                sample_id=text["sample_id"][k],
                subject=text["subject"][k],
                expression=text["expression"][k],
                split=text["split"][k],
                angles_deg=angles[k],
                rotation=values["rotation"][k].reshape(3, 3),
                camera=cameras.matrix[k],
                translation_mm=cameras.translation_mm[k],
                width=int(cameras.width[k]),
                height=int(cameras.height[k]),
                detected=bool(values["detected"][k]),
                points=points[k] if origin[k] else None,
                points_from=origin[k],
                visible=visible[k] if origin[k] and visible is not None else None,
                box=boxes[k],
                image=image,
                image_suffix=suffix,
            )

    def _points(
        self, batch: pa.RecordBatch, cameras: RowCameras
    ) -> tuple[np.ndarray, list[str], np.ndarray | None]:
        """Points [N, 68, 3], where each row's come from, and their visibility."""
        if not self.landmarks:
            return np.empty(0), [""] * len(batch), None
        chosen = self.points.indices
        exact_mm = as_array(batch, "landmarks_exact")[:, chosen]
        has_exact = np.isfinite(exact_mm).all(axis=(1, 2))
        visible = as_array(batch, "landmarks_visible")[:, chosen] if has_exact.any() else None
        exact = cameras.pixels(exact_mm)
        if self.landmarks == "exact":
            return exact, ["exact" if ok else "" for ok in has_exact], visible
        detected = as_array(batch, "detected").astype(bool)
        fill = ~detected & has_exact if self.missing == "exact" else np.zeros(len(batch), bool)
        points = np.where(
            fill[:, None, None], exact, as_array(batch, "landmarks")[:, chosen].astype(np.float64)
        )
        origin = np.where(fill, "exact", np.where(detected, "detected", "")).tolist()
        return points, origin, visible

    def _has_points(self, name: str, origin: str) -> bool:
        """Count one row; False if it is to be left out."""
        if origin or self.missing == "keep":
            self.rows += 1
            self.filled += bool(origin) and origin != self.landmarks
            return True
        if self.missing == "skip":
            self.left_out += 1
            return False
        what = "its head has no exact landmarks" if self.landmarks == "exact" else "no face was found"
        if self.landmarks == "detected" and self.missing == "exact":
            what += " and its head has no exact landmarks"
        self._refuse(name, what)
        return False

    def _refuse(self, name: str, what: str) -> None:
        rest = self.manifest.rows - self.manifest.detected_rows
        raise UsageError(
            f"{self.root}: {name} has no landmarks ({what}; {rest} rows of {self.manifest.rows} were not "
            "detected); choose --missing skip, or another --landmarks"
        )


def require_images(source: Source, name: str) -> None:
    """Raises DatasetError if a format that is made of images is asked of a dataset without any."""
    if source.manifest.images == "none":
        raise DatasetError(
            f"{source.root}: built with images = none, and {name} is made of images; "
            "build with --images files or embedded"
        )
