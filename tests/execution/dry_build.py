# SPDX-License-Identifier: GPL-3.0-or-later
"""Builds without a renderer: one dataset that is begun, stopped, grown and looked at."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
from no_renderer import NoRenderer, make_heads
from quiet import Quiet

from generator.dataset.format.manifest import read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.execution.build.run import BuildResult, build
from generator.plan.config import BuildConfig, load_config
from generator.plan.poses import pose_name

SMALL: dict[str, dict[str, Any]] = {
    "heads": {"units": "mm", "up": "+Y", "forward": "+Z"},
    "poses": {"yaw": [0, 20, 10], "pitch": [0, 0, 1], "roll": [0, 10, 10]},
    "render": {"resolution": 16},
    "dataset": {"images": "none", "unit_size": 4},
}
"""Six poses a head, in two units."""

DRAWN = {"kind": "sobol", "count": 6, "yaw": [-50, 50], "pitch": [-40, 40], "roll": [-30, 30]}
"""Six random poses a head, in two units."""


class DryBuild:
    """A folder of heads and a dataset of them.

    lanes: of the last build. said: what that build reported.
    """

    def __init__(self, folder: Path, *subjects: str) -> None:
        self.root, self.heads = folder / "dataset", make_heads(folder / "heads", *subjects)
        self.lanes, self.said = NoRenderer(), Quiet()

    def add(self, *subjects: str) -> None:
        """More heads in the folder."""
        make_heads(self.heads, *subjects)

    def config(self, **sections: dict[str, Any]) -> BuildConfig:
        """SMALL with changes."""
        values = {name: {**SMALL.get(name, {}), **sections.get(name, {})} for name in {*SMALL, *sections}}
        return load_config(None, {**values, "heads": {"source": str(self.heads), **values["heads"]}})

    def build(
        self,
        *,
        lanes: NoRenderer | None = None,
        fresh: bool = False,
        confirm: Callable[[str], bool] = lambda what: False,
        **sections: dict[str, Any],
    ) -> BuildResult:
        """Build with these changes to SMALL; nothing may be deleted unless confirm says so."""
        self.lanes, self.said = lanes or NoRenderer(), Quiet()
        return build(self.config(**sections), self.root, self.lanes, self.said, fresh=fresh, confirm=confirm)

    @property
    def rendered(self) -> list[str]:
        """Sample ids of what the last build rendered."""
        return sorted(
            f"{order.head.name}/{pose_name(*view.pose)}" for order in self.lanes.built for view in order.views
        )

    @property
    def parts(self) -> list[str]:
        """Names of the part files that are there."""
        return sorted(path.name for path in (self.root / "data").rglob("*.parquet"))

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Identity, pose and place in the grid of every row."""
        columns = ["sample_id", "yaw_deg", "pitch_deg", "roll_deg", "yaw_index", "pitch_index", "roll_index"]
        return pq.read_table(self.root / "data", columns=columns).sort_by("sample_id").to_pylist()

    @property
    def digest(self) -> str:
        """Of the finished dataset's content."""
        return read_manifest(self.root).digest

    def poses_of(self, subject: str) -> set[tuple[float, float, float]]:
        """The poses of a head's rows."""
        return {
            (row["yaw_deg"], row["pitch_deg"], row["roll_deg"])
            for row in self.rows
            if row["sample_id"].startswith(f"{subject}/")
        }

    def check(self) -> None:
        """The dataset is sound, and nothing lies about."""
        report = verify_dataset(self.root)
        assert report.ok, report.text()
        assert len(self.parts) == len(read_manifest(self.root).parts)
        assert not list(self.root.rglob(".*")), "nothing half-written, no lock"
