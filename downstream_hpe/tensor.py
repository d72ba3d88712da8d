# SPDX-License-Identifier: MIT
"""The pose tensor T of heads x yaw x pitch x roll x features, streamed from the tables.

One cell is one image: its landmarks, normalised and flattened to F = 3 * 468 numbers. A tensor is
never held whole; it is read head by head, as often as an algorithm passes over it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol, get_args

import numpy as np
import pyarrow as pa
import pyarrow.dataset as ds

from downstream_hpe import tables as tb
from downstream_hpe.errors import DataError
from downstream_hpe.grid import grid_axes, index_cells, places
from downstream_hpe.normalise import FEATURES, POINTS, Normalisation, normalise
from downstream_hpe.rotation import rotation_from_angles

Holes = Literal["refuse", "mask", "exact", "rotate"]
"""What to do with cells without landmarks: raise; leave them out of the fit; fill them from the
landmarks anchored on the surface; fill them with the head's own frontal landmarks, rotated."""

HOLES: tuple[Holes, ...] = get_args(Holes)

EXACT_COLUMNS = ("landmarks_exact", "camera", "translation_mm", "projection")


class Slabs(Protocol):
    """What :func:`downstream_hpe.decomposition.decompose` reads.

    shape: (N, Dy, Dp, Dr, F). observed: bool [N, Dy, Dp, Dr]. slabs(): N arrays [Dy, Dp, Dr, F],
    head by head, the same at every call; NaN where not observed.
    """

    @property
    def shape(self) -> tuple[int, int, int, int, int]: ...
    @property
    def observed(self) -> np.ndarray: ...
    def slabs(self) -> Iterator[np.ndarray]: ...


@dataclass(frozen=True)
class ArrayTensor:
    """A tensor in memory: values float [N, Dy, Dp, Dr, F], observed bool [N, Dy, Dp, Dr]."""

    values: np.ndarray
    observed: np.ndarray

    @property
    def shape(self) -> tuple[int, int, int, int, int]:
        return self.values.shape  # type: ignore[return-value]

    def slabs(self) -> Iterator[np.ndarray]:
        return iter(self.values)


@dataclass(frozen=True)
class HoleReport:
    """Which cells had no landmarks, and what became of them.

    cells: names, "subject/expression at yaw .., pitch .., roll ..". absent: how many of them have
    no row at all; the others have a row without a detected face. off_grid: rows left out because
    they are no cell of the grid.
    """

    cells: tuple[str, ...]
    absent: int
    off_grid: int
    treatment: Holes

    def text(self, names: int = 5) -> str:
        """One line; at most so many cells by name."""
        done = {
            "refuse": "",
            "mask": " left out of the fit",
            "exact": " filled from exact landmarks",
            "rotate": " filled with the head's rotated frontal landmarks",
        }[self.treatment]
        if not self.cells:
            return "every cell has landmarks"
        more = f" and {len(self.cells) - names} more" if len(self.cells) > names else ""
        return (
            f"{len(self.cells)} cells without landmarks{done} ({self.absent} of them without a row): "
            + "; ".join(self.cells[:names])
            + more
        )


@dataclass(frozen=True)
class PoseTensor:
    """The tensor of one dataset. Implements :class:`Slabs`.

    heads     "subject/expression" of each head, sorted
    axes_deg  three sorted float64 arrays: the angles of the grid
    observed  bool [N, Dy, Dp, Dr]: cells that slabs() gives numbers for, filled ones included
    missing   bool [N, Dy, Dp, Dr]: cells the detector gave no landmarks for
    """

    heads: tuple[str, ...]
    axes_deg: tuple[np.ndarray, np.ndarray, np.ndarray]
    missing: np.ndarray
    holes: Holes
    report: HoleReport
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
        return ~self.missing if self.holes == "mask" else np.ones_like(self.missing)

    def slabs(self) -> Iterator[np.ndarray]:
        """One float32 [Dy, Dp, Dr, 1404] a head, normalised; NaN where a cell is masked."""
        for head in range(len(self.heads)):
            yield self._slab(head)

    def to_array(self) -> np.ndarray:
        """The whole tensor in memory: float32 [N, Dy, Dp, Dr, 1404]."""
        return np.stack(list(self.slabs()))

    def _slab(self, head: int) -> np.ndarray:
        grid = self.shape[1:4]
        slab = np.full((*grid, POINTS, 3), np.nan, dtype=np.float32)
        columns = [
            *tb.HEAD_COLUMNS,
            *tb.INDEX_COLUMNS,
            *tb.ANGLE_COLUMNS,
            "rotation",
            "detected",
            "landmarks",
        ]
        if self.holes == "exact":
            columns += EXACT_COLUMNS
        subject, _, expression = self.heads[head].partition("/")
        rows = (ds.field("subject") == subject) & (ds.field("expression") == expression)
        for file in self.files[head]:
            for batch in tb.file_batches(file, columns, rows):
                tb.check_rows(self.where, batch)
                place = places(batch)
                on_grid = (place >= 0).all(axis=1)
                values = tb.landmarks(batch)
                if self.holes == "exact":
                    lost = ~tb.column(batch, "detected")
                    values = np.where(lost[:, None, None], _exact_in_pixels(batch), values)
                slab[tuple(place[on_grid].T)] = normalise(values[on_grid], self.normalisation)
        if self.holes == "rotate":
            self._rotate_frontal(head, slab)
        empty = np.argwhere(np.isnan(slab).any(axis=(3, 4)) & self.observed[head])
        if len(empty):
            raise DataError(
                f"{self.where}: no exact landmarks for {_cell(self.heads[head], self.axes_deg, empty[0])}"
            )
        return slab.reshape(*grid, FEATURES)

    def _rotate_frontal(self, head: int, slab: np.ndarray) -> None:
        cells = np.argwhere(self.missing[head])
        if not len(cells):
            return
        frontal = slab[tuple(_frontal_cell(self.axes_deg))]
        angles = np.stack([axis[cells[:, k]] for k, axis in enumerate(self.axes_deg)], axis=-1)
        slab[tuple(cells.T)] = frontal @ np.swapaxes(rotation_from_angles(angles), -1, -2)


def open_tensor(
    path: Path | str,
    *,
    holes: Holes = "refuse",
    normalisation: Normalisation = "rms",
    subjects: Collection[str] | None = None,
    expression: str | None = None,
) -> PoseTensor:
    """The tensor of a dataset; reads the small columns once, landmarks only when asked for.

    Parameters
    ----------
    path: dataset, folder of Parquet files, or one file.
    subjects, expression: only these rows; None: all of them.

    Raises
    ------
    DataError: as :func:`downstream_hpe.tables.open_tables`; fewer than two heads; two rows for
        one cell; cells without landmarks when holes is "refuse"; "exact" without the column;
        "rotate" where a head lacks its frontal cell; a head never detected.
    """
    columns = [
        *tb.HEAD_COLUMNS,
        *tb.INDEX_COLUMNS,
        *tb.ANGLE_COLUMNS,
        "rotation",
        "detected",
        "landmarks",
    ]
    found = tb.open_tables(path, columns)
    if holes == "exact":
        _require_exact(found)
    cells, files, off_grid = index_cells(found, subjects, expression)
    if len(cells) < 2:
        raise DataError(
            f"{found.path}: {len(cells)} heads on a grid, expected at least 2; "
            "a tensor of identities cannot be decomposed from one"
        )
    axes = grid_axes(found.path, cells)
    heads = tuple(sorted(cells))
    missing = np.ones((len(heads), *(len(axis) for axis in axes)), dtype=bool)
    absent = missing.copy()
    for n, head in enumerate(heads):
        for place, (_, detected) in cells[head].items():
            missing[(n, *place)] = not detected
            absent[(n, *place)] = False
    names = tuple(_cell(heads[cell[0]], axes, cell[1:]) for cell in np.argwhere(missing))
    report = HoleReport(names, int(absent.sum()), off_grid, holes)
    if holes == "refuse" and names:
        raise DataError(f"{found.path}: {report.text()}; choose a treatment: mask, exact or rotate")
    if holes == "exact" and absent.any():
        first = np.argwhere(absent)[0]
        name = _cell(heads[first[0]], axes, first[1:])
        raise DataError(
            f"{found.path}: no row for {name}, so no exact landmarks either; build it again or use mask"
        )
    empty = missing.all(axis=(1, 2, 3))
    if holes == "mask" and empty.any():
        raise DataError(f"{found.path}: {heads[int(np.argmax(empty))]} was never detected; leave it out")
    if holes == "rotate":
        _require_frontal(found.path, heads, axes, missing)
    every = tuple(tuple(files[head]) for head in heads)
    return PoseTensor(heads, axes, missing, holes, report, normalisation, found.path, every)


def _require_exact(found: tb.Tables) -> None:
    for file in found.files:
        for name in EXACT_COLUMNS:
            if name not in file.physical_schema.names:
                raise DataError(f"{file.path}: no column {name}; choose mask or rotate for its holes")


def _require_frontal(
    where: Path, heads: tuple[str, ...], axes: tuple[np.ndarray, ...], missing: np.ndarray
) -> None:
    if any(0.0 not in axis for axis in axes):
        raise DataError(f"{where}: the grid has no cell at 0, 0, 0, which 'rotate' needs; use mask")
    frontal = _frontal_cell(axes)
    for head, gone in zip(heads, missing, strict=True):
        if gone[tuple(frontal)] and gone.any():
            raise DataError(f"{where}: {head} has no landmarks at 0, 0, 0, which 'rotate' needs; use mask")


def _frontal_cell(axes: tuple[np.ndarray, ...]) -> list[int]:
    return [int(np.flatnonzero(axis == 0.0)[0]) for axis in axes]


def _cell(head: str, axes: tuple[np.ndarray, ...], place: np.ndarray) -> str:
    return tb.cell_name(head, [float(axis[i]) for axis, i in zip(axes, place, strict=True)])


def _exact_in_pixels(batch: pa.RecordBatch) -> np.ndarray:
    """Exact landmarks (X, Y, Z) as the detector would give them: projected, depth at the mean scale.

    perspective:  u = K (X/Z, Y/Z, 1), depth f (Z - Zm) / Zm with Zm the mean of Z
    orthographic: u = K (X/t, Y/t, 1), depth f (Z - Zm) / t with t the pivot's distance
    """
    points = tb.vectors(batch, "landmarks_exact", FEATURES).reshape(-1, POINTS, 3).astype(np.float64)
    camera = tb.vectors(batch, "camera", 9).reshape(-1, 3, 3)
    parallel = (tb.column(batch, "projection") == "orthographic")[:, None]
    z = points[..., 2]
    middle = z.mean(axis=1)[:, None]
    pivot = tb.vectors(batch, "translation_mm", 3)[:, 2:]
    divisor = np.where(parallel, pivot, z)[..., None]
    rays = np.concatenate([points[..., :2] / divisor, np.ones_like(divisor)], axis=-1)
    pixels = rays @ np.swapaxes(camera, -1, -2)
    pixels[..., 2] = camera[:, 0, 0, None] * (z - middle) / np.where(parallel, pivot, middle)
    return pixels.astype(np.float32)
