# SPDX-License-Identifier: MIT
"""The pose tensor T of heads x yaw x pitch x roll x features, streamed from the tables.

One cell is one image: its landmarks, normalised and flattened to F = 3 * 468 numbers. A tensor is
never held whole; it is read head by head, as often as an algorithm passes over it.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow.dataset as ds

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.geometry.face_mesh import FEATURES, POINTS
from downstream_hpe.geometry.normalise import Normalisation, normalise
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.tables.columns import (
    ANGLE_COLUMNS,
    HEAD_COLUMNS,
    INDEX_COLUMNS,
    cell_name,
    check_columns,
    check_rows,
    column,
    landmarks_of,
)
from downstream_hpe.tables.grid import grid_axes, index_cells, places
from downstream_hpe.tables.missing import (
    EXACT_COLUMNS,
    MISSING,
    Missing,
    MissingReport,
    exact_in_pixels,
    turned_frontal,
)
from downstream_hpe.tables.open import Tables, file_batches, open_tables

Axes = tuple[np.ndarray, np.ndarray, np.ndarray]
"""The grid's angles of yaw, pitch and roll, degrees, rising."""
Demands = Callable[[int, Axes], list[str]]
"""What a number of heads on a grid lacks for what is meant with it, a phrase each."""

COLUMNS = (*HEAD_COLUMNS, *INDEX_COLUMNS, *ANGLE_COLUMNS, "rotation", "detected", "landmarks")


@dataclass(frozen=True)
class PoseTensor:
    """The tensor of one dataset. Implements :class:`downstream_hpe.manifold.slabs.SlabsWithGaps`.

    heads     "subject/expression" of each head, sorted
    axes_deg  three sorted float64 arrays: the angles of the grid
    observed  bool [N, Dy, Dp, Dr]: cells that slabs() gives numbers for, filled ones included
    empty     bool [N, Dy, Dp, Dr]: cells the detector gave no landmarks for
    missing   what becomes of these
    """

    heads: tuple[str, ...]
    axes_deg: tuple[np.ndarray, np.ndarray, np.ndarray]
    empty: np.ndarray
    missing: Missing
    report: MissingReport
    normalisation: Normalisation
    where: Path
    files: tuple[tuple[ds.ParquetFileFragment, ...], ...] = field(repr=False)
    """The files that hold each head."""

    @property
    def shape(self) -> tuple[int, int, int, int, int]:
        y, p, r = (len(axis) for axis in self.axes_deg)
        return len(self.heads), y, p, r, FEATURES

    @property
    def observed(self) -> np.ndarray:
        return ~self.empty if self.missing == "keep" else np.ones_like(self.empty)

    def slabs(self) -> Iterator[np.ndarray]:
        """One float32 [Dy, Dp, Dr, 1404] a head, normalised; NaN where a cell is not observed."""
        for head in range(len(self.heads)):
            yield self._slab(head)

    def to_array(self) -> np.ndarray:
        """The whole tensor in memory: float32 [N, Dy, Dp, Dr, 1404]."""
        return np.stack(list(self.slabs()))

    def _slab(self, head: int) -> np.ndarray:
        grid = self.shape[1:4]
        slab = np.full((*grid, POINTS, 3), np.nan, dtype=np.float32)
        exact = self.missing == "exact"
        columns = [*COLUMNS, *(EXACT_COLUMNS if exact else ())]
        subject, _, expression = self.heads[head].partition("/")
        rows = (ds.field("subject") == subject) & (ds.field("expression") == expression)
        for file in self.files[head]:
            for batch in file_batches(file, columns, rows):
                check_rows(self.where, batch)
                place = places(batch)
                on_grid = (place >= 0).all(axis=1)
                values = landmarks_of(batch)
                if exact:
                    lost = ~column(batch, "detected")
                    values = np.where(lost[:, None, None], exact_in_pixels(batch), values)
                slab[tuple(place[on_grid].T)] = normalise(values[on_grid], self.normalisation)
        if self.missing == "frontal":
            angles = np.stack(np.meshgrid(*self.axes_deg, indexing="ij"), axis=-1)
            slab[self.empty[head]] = turned_frontal(slab, self.empty[head], rotation_from_angles(angles))
        lacking = np.argwhere(np.isnan(slab).any(axis=(3, 4)) & self.observed[head])
        if len(lacking):
            raise DataError(
                f"{self.where}: no exact landmarks for {_cell(self.heads[head], self.axes_deg, lacking[0])}"
            )
        return slab.reshape(*grid, FEATURES)


def two_heads(heads: int, axes: Axes) -> list[str]:
    """A tensor of identities cannot be decomposed from one. Implements Demands."""
    return [] if heads > 1 else [f"{heads} heads on a grid, expected at least 2"]


def open_tensor(
    path: Path | str,
    *,
    missing: Missing = "fail",
    normalisation: Normalisation = "rms",
    subjects: Collection[str] | None = None,
    expression: str | None = None,
    demands: Demands = two_heads,
) -> PoseTensor:
    """The tensor of a dataset; reads the small columns once, landmarks only when asked for.

    Parameters
    ----------
    path: dataset, folder of Parquet files, or one file.
    missing: what becomes of cells without landmarks, see :data:`downstream_hpe.tables.missing.Missing`.
    subjects, expression: only these rows; None: all of them.
    demands: of heads and grid, all said at once, with the missing cells where these fail.

    Raises
    ------
    DataError: as :func:`downstream_hpe.tables.open.open_tables`; no head, or a demand; two rows for
        one cell; cells without landmarks when missing is "fail"; "exact" without the columns or the
        row for it; "keep" or "frontal" where a head was never detected. UsageError: another word.
    """
    if missing not in MISSING:
        raise UsageError(f"missing cells: {missing!r} is none of {', '.join(MISSING)}")
    found = open_tables(path, COLUMNS)
    if missing == "exact":
        _require_exact(found)
    cells, files, off_grid = index_cells(found, subjects, expression)
    if not cells:
        raise DataError(f"{found.path}: no head on a grid; build with a grid of poses")
    axes = grid_axes(found.path, cells)
    heads = tuple(sorted(cells))
    empty = np.ones((len(heads), *(len(axis) for axis in axes)), dtype=bool)
    absent = empty.copy()
    for n, head in enumerate(heads):
        for place, (_, detected) in cells[head].items():
            empty[(n, *place)] = not detected
            absent[(n, *place)] = False
    names = tuple(_cell(heads[cell[0]], axes, cell[1:]) for cell in np.argwhere(empty))
    report = MissingReport(names, int(absent.sum()), off_grid, missing)
    lacking = demands(len(heads), axes)
    if missing == "fail" and names:
        lacking.append(f"{report.text()}; choose --missing keep, exact or frontal")
    if lacking:
        raise DataError(f"{found.path}: {'; '.join(lacking)}")
    if missing == "exact" and absent.any():
        first = np.argwhere(absent)[0]
        name = _cell(heads[first[0]], axes, first[1:])
        raise DataError(
            f"{found.path}: no row for {name}, so no exact landmarks either; "
            "build it again or choose --missing keep"
        )
    never = empty.all(axis=(1, 2, 3))
    if missing in ("keep", "frontal") and never.any():
        raise DataError(f"{found.path}: {heads[int(np.argmax(never))]} was never detected; leave it out")
    every = tuple(tuple(files[head]) for head in heads)
    return PoseTensor(heads, axes, empty, missing, report, normalisation, found.path, every)


def _require_exact(found: Tables) -> None:
    for file in found.files:
        check_columns(file.path, file.physical_schema, EXACT_COLUMNS, "choose --missing keep or frontal")


def _cell(head: str, axes: tuple[np.ndarray, ...], place: np.ndarray) -> str:
    return cell_name(head, [float(axis[i]) for axis, i in zip(axes, place, strict=True)])
