# SPDX-License-Identifier: MIT
"""One face of a picture or frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LOW_CONFIDENCE = 0.4
"""Below it a pose is drawn as uncertain. Plain faces near the front come to 0.5 to 0.7, for labels of
photographs are no oftener within 5 degrees of it; masks and what is no plausible face to less than this."""


@dataclass(frozen=True)
class Placed:
    """Where a head is. ypr_deg float64 [3]: relative to the optical axis. translation_mm float64 [3]: of the
    pivot between the ears, frame C. focal_px: of the camera; guessed: no one said what it is."""

    ypr_deg: np.ndarray
    translation_mm: np.ndarray
    focal_px: float
    guessed: bool


@dataclass(frozen=True)
class Face:
    """index: which face of the picture or video. landmarks float [468, 3], pixels. rotation float64 [3, 3],
    R_C, and ypr_deg float64 [3]: as seen towards the face. confidence: 0 to 1, None where the model gives
    none. in_range: whether the angles are among those the model was trained on. placed: None where no place
    before the camera fits."""

    index: int
    landmarks: np.ndarray
    rotation: np.ndarray
    ypr_deg: np.ndarray
    confidence: float | None
    in_range: bool
    placed: Placed | None = None

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Around the landmarks: left, top, width, height, pixels."""
        low, high = self.landmarks[:, :2].min(axis=0), self.landmarks[:, :2].max(axis=0)
        return (*low.tolist(), *(high - low).tolist())

    @property
    def sure(self) -> bool:
        """Whether the pose may be believed."""
        return self.in_range and (self.confidence is None or self.confidence >= LOW_CONFIDENCE)
