# SPDX-License-Identifier: GPL-3.0-or-later
"""The detector over poses: where it finds the face, and by how much it is off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from generator.dataset.format.columns import further_column
from generator.dataset.format.further import also_of, first_of, seen_by
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import as_array, read_rows
from generator.dataset.format.row_cameras import COLUMNS as CAMERA
from generator.dataset.show.report.cells import PoseCells
from generator.dataset.show.report.errors import RowErrors, row_errors
from generator.landmarks.topology import FACE_MESH, Topology
from generator.plan.poses import ANGLES

NUMBERS = 600_000
"""Numbers that all maps of single heads may hold together: keeps the page at a few megabytes."""

_COLUMNS = [
    *("subject", "expression", "rotation", *CAMERA, "detected", "landmarks", "landmarks_exact"),
    *(f"{angle}_deg" for angle in ANGLES),
]


class Atlas:
    """Sums over cells of pose, for all heads together (place 0) and for some heads of their own."""

    def __init__(
        self,
        heads: Sequence[HeadRow],
        cells: PoseCells,
        topology: Topology = FACE_MESH,
        numbers: int = NUMBERS,
    ) -> None:
        self.cells, self.topology = cells, topology
        regions, points = len(topology.regions), topology.count
        layers = 3 + 5 * regions + 7
        room = max(1, numbers // (layers * len(cells)))
        picked = np.unique(np.linspace(0, len(heads) - 1, min(room, len(heads))).round().astype(int))
        self.heads = [heads[i] for i in picked]
        self._slot = {(head.subject, head.expression): k for k, head in enumerate(self.heads, start=1)}
        shape = (len(self.heads) + 1, len(cells))
        self.rows, self.detected, self.compared = (np.zeros(shape, np.int64) for _ in range(3))
        self._region = np.zeros((*shape, regions, 4))
        self._region_rows = np.zeros((*shape, regions), np.int64)
        self._pose = np.zeros((*shape, 7))  # geodesic; yaw, pitch, roll; their squares
        self._point_rows = np.zeros(points, np.int64)
        self._point = np.zeros((points, 4))  # distance; shift in the head's frame
        self._face = np.zeros((points, 3))  # position in the head's frame, mm
        self._mm = 0.0
        self._by_head: dict[tuple[str, str], np.ndarray] = {}

    def add(self, batch: pa.RecordBatch) -> None:
        """Count the rows of a batch."""
        names = list(
            zip(*(batch.column(name).to_pylist() for name in ("subject", "expression")), strict=True)
        )
        slots = np.array([self._slot.get(name, -1) for name in names], np.int64)
        cells = self.cells.place(np.stack([as_array(batch, f"{angle}_deg") for angle in ANGLES], axis=-1))
        detected = as_array(batch, "detected").astype(bool)
        errors = row_errors(batch, self.topology)
        distance = errors.region[:, 0, 2]
        for name, found in zip(names, detected, strict=True):
            self._by_head.setdefault(name, np.zeros(4))[:2] += (1, found)
        for row, value in zip(errors.rows.tolist(), distance.tolist(), strict=True):
            self._by_head[names[row]][2:] += (1, value)
        self._count(np.zeros_like(slots), cells, detected, errors)
        self._count(slots, cells, detected, errors)
        self._mm += float((distance * errors.mm_per_px).sum())
        self._add_points(batch, errors.rows, errors.distance_px, errors.shift_head)

    def _count(self, slots: np.ndarray, cells: np.ndarray, detected: np.ndarray, errors: RowErrors) -> None:
        """Add rows to the maps of slots; rows at slot -1 have none."""
        own = slots >= 0
        np.add.at(self.rows, (slots[own], cells[own]), 1)
        np.add.at(self.detected, (slots[own], cells[own]), detected[own])
        compared = own[errors.rows]
        rows = errors.rows[compared]
        place = (slots[rows], cells[rows])
        region, turn = errors.region[compared], errors.pose_deg[compared]
        known = np.isfinite(region[..., 0])
        np.add.at(self.compared, place, 1)
        np.add.at(self._region, place, np.where(known[..., None], region, 0.0))
        np.add.at(self._region_rows, place, known)
        np.add.at(self._pose, place, np.column_stack([errors.geodesic_deg[compared], turn, turn**2]))

    def _add_points(
        self, batch: pa.RecordBatch, rows: np.ndarray, distance: np.ndarray, shift: np.ndarray
    ) -> None:
        there = np.isfinite(distance)
        values = np.concatenate([distance[..., None], shift], axis=-1)
        self._point_rows += there.sum(axis=0)
        self._point += np.where(there[..., None], values, 0.0).sum(axis=0)
        exact = as_array(batch, "landmarks_exact")[rows] - as_array(batch, "translation_mm")[rows, None]
        face = exact @ as_array(batch, "rotation")[rows].reshape(-1, 3, 3)
        self._face += np.where(there[..., None], face, 0.0).sum(axis=0)

    def frame(self) -> dict[str, Any]:
        """What the maps are over."""
        return {
            "axes": {name: axis.tolist() for name, axis in zip(ANGLES, self.cells.axes, strict=True)},
            "binned": self.cells.binned,
            "regions": list(self.topology.regions),
            "picks": ["all heads", *(f"{head.subject} / {head.expression}" for head in self.heads)],
        }

    def as_dict(self) -> dict[str, Any]:
        """The maps, for the page; numbers rounded to three decimals, null where there are none."""
        return {
            "detected": int(self.detected[0].sum()),
            "overall": self.overall,
            "maps": [self._map(slot) for slot in range(len(self.heads) + 1)],
            "points": self._points(),
        }

    @property
    def overall(self) -> dict[str, float | None]:
        """Means over all rows that were compared: distance in px and mm, geodesic pose error in degrees."""
        rows = int(self.compared[0].sum())
        if not rows:
            return {"compared": 0, "distance_px": None, "distance_mm": None, "geodesic_deg": None}
        return {
            "compared": rows,
            "distance_px": round(float(self._region[0, :, 0, 2].sum()) / rows, 4),
            "distance_mm": round(self._mm / rows, 4),
            "geodesic_deg": round(float(self._pose[0, :, 0].sum()) / rows, 4),
        }

    def of_head(self, subject: str, expression: str) -> dict[str, float | None]:
        """Rows, detected rows and mean distance in px of one head."""
        rows, detected, compared, total = self._by_head.get((subject, expression), np.zeros(4)).tolist()
        mean = round(total / compared, 3) if compared else None
        return {"rows": int(rows), "detected": int(detected), "distance_px": mean}

    def _map(self, slot: int) -> dict[str, Any]:
        compared, region_rows = self.compared[slot], self._region_rows[slot]
        region = _over(self._region[slot], region_rows[..., None])
        spread = np.sqrt(np.maximum(region[..., 3] - region[..., 0] ** 2 - region[..., 1] ** 2, 0.0))
        pose = _over(self._pose[slot], compared[:, None])
        turn, turn_spread = pose[:, 1:4], np.sqrt(np.maximum(pose[:, 4:] - pose[:, 1:4] ** 2, 0.0))
        return {
            "rows": self.rows[slot].tolist(),
            "detected": self.detected[slot].tolist(),
            "compared": compared.tolist(),
            "regions": [
                {
                    "rows": region_rows[:, k].tolist(),
                    "dx": _rounded(region[:, k, 0]),
                    "dy": _rounded(region[:, k, 1]),
                    "distance": _rounded(region[:, k, 2]),
                    "spread": _rounded(spread[:, k]),
                }
                for k in range(region.shape[1])
            ],
            "geodesic": _rounded(pose[:, 0]),
            "turn": [_rounded(axis) for axis in turn.T],
            "turn_spread": [_rounded(axis) for axis in turn_spread.T],
        }

    def _points(self) -> dict[str, Any]:
        mean = _over(self._point, self._point_rows[:, None])
        face = _over(self._face, self._point_rows[:, None])
        return {
            "x": _rounded(face[:, 0], 1),
            "y": _rounded(face[:, 1], 1),
            "distance": _rounded(mean[:, 0]),
            "dx": _rounded(mean[:, 1]),
            "dy": _rounded(mean[:, 2]),
        }


def collect_atlases(
    root: Path,
    manifest: Manifest,
    heads: Sequence[HeadRow],
    cells: PoseCells,
    progress: Callable[[int], None],
    topology: Topology = FACE_MESH,
) -> dict[str, Atlas]:
    """One a detector, by its name, the first one first. Reads all rows once.

    Raises DatasetError: a part is missing or damaged.
    """
    also = also_of(manifest)
    numbers = NUMBERS // (1 + len(also))
    first = Atlas(heads, cells, topology, numbers)
    further = {name: Atlas(heads, cells, topology, numbers) for name in also}
    for batch in read_rows(root, manifest.parts, [*_COLUMNS, *map(further_column, also)]):
        first.add(batch)
        for name, atlas in further.items():
            atlas.add(seen_by(batch, name))
        progress(len(batch))
    return {first_of(manifest): first, **further}


def _over(total: np.ndarray, count: np.ndarray) -> np.ndarray:
    return np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)


def _rounded(values: np.ndarray, digits: int = 3) -> list[float | None]:
    return [round(value, digits) + 0.0 if value == value else None for value in values.tolist()]
