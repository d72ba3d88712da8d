# SPDX-License-Identifier: GPL-3.0-or-later
"""One row as an exporter sees it."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np

from generator.dataset.export.options import ImageFormat
from generator.dataset.format.image import decode_image, image_format
from generator.plan.poses import pose_name

JPEG_QUALITY = 95


@dataclass(frozen=True, eq=False)
class Sample:
    """One row.

    angles_deg     float64 [3] (yaw, pitch, roll)
    rotation       float64 [3, 3], R_C
    camera         float64 [3, 3], K; translation_mm float64 [3], the pivot in frame C
    points         float64 [68, 3] or None: iBUG's points in isotropic pixels, frame C; z = 0 at the
                   pivot's depth where they come from the mesh
    points_from    "exact", "detected", or "" without points
    visible        bool [68] or None where nobody knows
    box            float64 [4], x1 y1 x2 y2 in pixels around the face, or None where nobody knows
    image          the encoded file, b"" where the format takes none; image_suffix such as ".png"
    """

    sample_id: str
    subject: str
    expression: str
    split: str
    angles_deg: np.ndarray
    rotation: np.ndarray
    camera: np.ndarray
    translation_mm: np.ndarray
    width: int
    height: int
    detected: bool
    points: np.ndarray | None
    points_from: str
    visible: np.ndarray | None
    box: np.ndarray | None
    image: bytes
    image_suffix: str

    @property
    def head(self) -> tuple[str, str]:
        """(subject, expression)."""
        return self.subject, self.expression

    @property
    def pose(self) -> str:
        """The pose's name, such as "y+10_p-20_r+0"."""
        yaw, pitch, roll = self.angles_deg.tolist()
        return pose_name(yaw, pitch, roll)

    def encoded(self, kind: ImageFormat) -> bytes:
        """The image as kind. Raises DatasetError if it cannot be decoded."""
        return self.png() if kind == "png" else self.jpeg()

    def jpeg(self) -> bytes:
        """The image as JPEG, its own bytes if it is one. Raises DatasetError if it cannot be decoded."""
        return self._encoded("JPEG", quality=JPEG_QUALITY, subsampling=0)

    def png(self) -> bytes:
        """The image as PNG, its own bytes if it is one. Raises DatasetError if it cannot be decoded."""
        return self._encoded("PNG")

    def _encoded(self, kind: str, **options: int) -> bytes:
        name = f"the image of {self.sample_id}"
        if image_format(self.image, name) == kind:
            return self.image
        file = io.BytesIO()
        decode_image(self.image, name).save(file, kind, **options)
        return file.getvalue()


_SUFFIXES = {"PNG": ".png", "JPEG": ".jpg"}


def suffix_of(encoded: bytes, name: str) -> str:
    """The suffix that an image gets, by its header: what a file is called says nothing about it.

    name: of its row. Raises DatasetError: it is neither PNG nor JPEG.
    """
    return _SUFFIXES[image_format(encoded, f"the image of {name}")]
