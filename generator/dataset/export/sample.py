# SPDX-License-Identifier: GPL-3.0-or-later
"""One row as an exporter sees it."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np
from PIL import Image, UnidentifiedImageError

from generator.errors import DatasetError
from generator.escape import printable
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

    def jpeg(self) -> bytes:
        """The image as JPEG, its own bytes if it is one. Raises DatasetError if it cannot be decoded."""
        return self._encoded("JPEG", (".jpg", ".jpeg"), quality=JPEG_QUALITY, subsampling=0)

    def png(self) -> bytes:
        """The image as PNG, its own bytes if it is one. Raises DatasetError if it cannot be decoded."""
        return self._encoded("PNG", (".png",))

    def _encoded(self, kind: str, suffixes: tuple[str, ...], **options: int) -> bytes:
        if self.image_suffix in suffixes:
            return self.image
        try:
            picture = Image.open(io.BytesIO(self.image)).convert("RGB")
        except (UnidentifiedImageError, OSError) as error:
            raise DatasetError(
                f"the image of {self.sample_id} cannot be decoded; see `headturn verify`"
            ) from error
        file = io.BytesIO()
        picture.save(file, kind, **options)
        return file.getvalue()


_BEGINNINGS = {b"\x89PNG\r\n\x1a\n": ".png", b"\xff\xd8\xff": ".jpg"}


def suffix_of(encoded: bytes, name: str) -> str:
    """The suffix that an image gets, by its first bytes: what a file is called says nothing about it.

    name: of its row. Raises DatasetError: it is neither PNG nor JPEG.
    """
    for beginning, suffix in _BEGINNINGS.items():
        if encoded.startswith(beginning):
            return suffix
    raise DatasetError(f"the image of {printable(name)} is neither PNG nor JPEG; see `headturn verify`")
