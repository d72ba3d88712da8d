# SPDX-License-Identifier: GPL-3.0-or-later
"""What the rows of a dataset are compared with."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import numpy as np

from generator.dataset.format.columns import ImageMode
from generator.dataset.format.dataset_poses import DatasetPoses
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.schema import is_newer
from generator.errors import DatasetError, UsageError
from generator.plan.config import BuildConfig, recorded_config
from generator.plan.settings import known_values
from generator.plan.view_plan import plan_views
from generator.plan.views import View, Views

HEADS_AT_HAND = 8
"""Heads whose views are kept: the parts of a head lie together."""

ExpectedView = Callable[[int, int], View]
"""(place in heads.parquet, place in the head's plan) -> the view that row has to be."""


def known_config(manifest: Manifest, root: Path) -> BuildConfig:
    """The recorded configuration, as far as we know its settings.

    Raises DatasetError if it is none.
    """
    configuration = manifest.configuration
    if is_newer(manifest.schema_version):  # it may have settings that we do not know
        configuration = known_values(configuration)
    try:
        return recorded_config(configuration, root)
    except UsageError as error:
        raise DatasetError(
            f"manifest.json: its configuration cannot be read ({error}); run `headturn build` again"
        ) from error


def planned_views(
    heads: Sequence[HeadRow], poses: DatasetPoses, manifest: Manifest, root: Path
) -> ExpectedView:
    """The views that the recorded configuration plans for heads of the recorded sizes.

    Neither heads.parquet nor the rows are asked: their cameras and looks are what is to be proved.
    Raises DatasetError if the configuration is none.
    """
    config = known_config(manifest, root)

    @lru_cache(maxsize=HEADS_AT_HAND)
    def views(head: int) -> Views:
        row = heads[head]
        angles = poses.plan(head).angles_deg.tolist()
        name = f"{row.subject}/{row.expression}"
        return plan_views(config, name, row.radius_mm, [*map(tuple, angles)], row.own_camera)

    return lambda head, pose: views(head)[pose]


@dataclass(frozen=True, eq=False)
class RowContext:
    """Of one batch of a part.

    split: the folder the part lies in. factor: the rows are twins with this one changed; "": they are none.
    heads, poses: the tables, where there are any yet.
    anchors: float64 [heads, P, 3], at pose zero, frame C, mm; NaN where there is none.
    head_index, pose_index: int [N], the place of each row of the batch in heads and its plan, none below 0.
    measured: the largest values that checks came across, by name.
    """

    root: Path
    images: ImageMode
    anchors: np.ndarray
    expected_view: ExpectedView
    heads: Sequence[HeadRow] = ()
    poses: DatasetPoses | None = None
    split: str = ""
    factor: str = ""
    head_index: np.ndarray = field(default_factory=lambda: np.empty(0, np.int32))
    pose_index: np.ndarray = field(default_factory=lambda: np.empty(0, np.int32))
    measured: dict[str, float] = field(default_factory=dict)

    def note(self, name: str, value: float) -> None:
        """Remember a value if it is the largest of its name so far."""
        self.measured[name] = max(value, self.measured.get(name, value))
