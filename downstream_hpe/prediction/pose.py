# SPDX-License-Identifier: MIT
"""What a model says of faces."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

SHOWN = 8
"""So many faces a repr tells of."""


@dataclass(frozen=True, eq=False, repr=False)
class Pose:
    """Of N faces. ypr_deg float32 [N, 3], (yaw, pitch, roll), and rotation float32 [N, 3, 3], R_C: as seen
    towards the face. confidence float32 [N], 0 to 1, or None where the model gives none.

    With a camera, else None: axis_ypr_deg float64 [N, 3] and axis_rotation float64 [N, 3, 3], relative to
    the optical axis; translation_mm float64 [N, 3], of the pivot between the ears, frame C, in the scale of
    the mean head. NaN where no place before the camera fits the landmarks.

    landmarks float [N, 468, 3]: what it was said of, of a picture in its pixels. in_range bool [N]: whether
    the angles are among those the model was trained on. A Predictor gives both.

    >>> Pose(np.array([[12.34, -4, 1]]), np.eye(3)[None], np.array([0.57]))
    Pose(1 face: yaw +12.3, pitch -4.0, roll +1.0 degrees, confidence 0.57)
    """

    ypr_deg: np.ndarray
    rotation: np.ndarray
    confidence: np.ndarray | None = None
    axis_ypr_deg: np.ndarray | None = None
    axis_rotation: np.ndarray | None = None
    translation_mm: np.ndarray | None = None
    landmarks: np.ndarray | None = None
    in_range: np.ndarray | None = None

    def __len__(self) -> int:
        """How many faces."""
        return len(self.ypr_deg)

    def __eq__(self, other: object) -> bool:
        """Whether every number is the same, NaN and NaN too."""
        if not isinstance(other, Pose):
            return NotImplemented
        pairs = [(getattr(self, field.name), getattr(other, field.name)) for field in fields(self)]
        return all(
            a is b if a is None or b is None else np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
            for a, b in pairs
        )

    __hash__ = None  # type: ignore[assignment]  # arrays can be changed

    def __repr__(self) -> str:
        lines = [self._line(n) for n in range(min(len(self), SHOWN))]
        lines += [f"and {len(self) - SHOWN} more"] if len(self) > SHOWN else []
        if len(self) < 2:
            return f"Pose({len(self)} face{'' if lines else 's'}{''.join(f': {line}' for line in lines)})"
        return "\n  ".join([f"Pose({len(self)} faces:", *lines]) + ")"

    def _line(self, n: int) -> str:
        yaw, pitch, roll = self.ypr_deg[n].tolist()
        text = f"yaw {yaw:+.1f}, pitch {pitch:+.1f}, roll {roll:+.1f} degrees"
        if self.confidence is not None:
            text += f", confidence {float(self.confidence[n]):.2f}"
        if self.in_range is not None and not self.in_range[n]:
            text += ", outside the trained range"
        return text
