# SPDX-License-Identifier: GPL-3.0-or-later
"""What was drawn for each row, read from the row itself."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa

from generator.dataset.format.columns import LOOKS
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.open import as_array
from generator.dataset.format.row_cameras import COLUMNS as CAMERA
from generator.dataset.format.row_cameras import RowCameras
from generator.dataset.show.factors import Factor
from generator.geometry.camera import SENSOR_MM
from generator.plan.settings import known_values

Read = Callable[[RowCameras, np.ndarray], np.ndarray]
"""Cameras and radius_mm of the heads, float64 [N], -> what was drawn, float64 [N]."""

_OF_CAMERAS: dict[str, Read] = {
    "distance_mm": lambda cameras, _: cameras.translation_mm[:, 2],
    "lens_mm": lambda cameras, _: cameras.matrix[:, 0, 0] * SENSOR_MM / cameras.width,
    "margin": lambda cameras, radius_mm: _margin(cameras, radius_mm),
    "shift_x": lambda cameras, _: cameras.matrix[:, 0, 2] / cameras.width - 0.5,
    "shift_y": lambda cameras, _: cameras.matrix[:, 1, 2] / cameras.height - 0.5,
}
"""By the key of a setting that has no column: the camera's."""


class DrawnValues:
    """Reads them.

    factors: those of some that rows tell of. columns: what a batch needs for them.
    """

    def __init__(
        self, factors: Sequence[Factor], heads: Sequence[HeadRow], configuration: Mapping[str, Any]
    ) -> None:
        """configuration: of the dataset, as its manifest has it."""
        render = known_values(dict(configuration)).get("render", {})
        without = {"margin"} if render.get("distance_mm") is not None else set()
        if render.get("zoom") and without:
            without = {"lens_mm"}  # the margin decides it, and it decides no more
        keys = {*LOOKS.values(), *_OF_CAMERAS} - without
        self.factors = [one for one in factors if one.setting.section == "render" and one.setting.key in keys]
        looks = [f"look_{one.setting.key}" for one in self.factors if one.setting.key in LOOKS.values()]
        self.columns = list(dict.fromkeys(["subject", "expression", *CAMERA, *looks]))
        self._radius = {(head.subject, head.expression): head.radius_mm for head in heads}

    def of(self, batch: pa.RecordBatch) -> list[np.ndarray]:
        """What was drawn of each factor, [N]: float64, or texts as objects."""
        cameras = RowCameras.of(batch)
        names = zip(*(batch.column(name).to_pylist() for name in ("subject", "expression")), strict=True)
        radius = np.array([self._radius.get(name, np.nan) for name in names])
        return [self._one(one, batch, cameras, radius) for one in self.factors]

    @staticmethod
    def _one(one: Factor, batch: pa.RecordBatch, cameras: RowCameras, radius: np.ndarray) -> np.ndarray:
        if one.setting.key in _OF_CAMERAS:
            return _OF_CAMERAS[one.setting.key](cameras, radius)
        values = as_array(batch, f"look_{one.setting.key}")
        return values if one.place is None else values[:, one.place]


def _margin(cameras: RowCameras, radius_mm: np.ndarray) -> np.ndarray:
    """The inverse of :func:`generator.plan.view_plan.framed_camera`."""
    tangent = cameras.width / 2 / cameras.matrix[:, 0, 0]
    reach = np.where(cameras.projection == "orthographic", tangent, tangent / np.hypot(1, tangent))
    shorter = np.minimum(cameras.width, cameras.height) / cameras.width
    return reach * cameras.translation_mm[:, 2] / radius_mm * shorter
