# SPDX-License-Identifier: GPL-3.0-or-later
"""Rows and their twins, two by two: measured, and which of the two is plain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from generator.dataset.ablate.measures import COLUMNS, DETECTOR, detector_measures
from generator.dataset.format.manifest import Manifest, read_manifest
from generator.dataset.format.open import as_array, dataset_topology, read_rows
from generator.dataset.proof.context import known_config
from generator.errors import DatasetError
from generator.landmarks.topology import Topology
from generator.plan.config import BuildConfig
from generator.plan.factors import FACTORS
from generator.plan.poses import ANGLES
from generator.plan.twins import is_plain
from generator.plan.view_plan import drawn_render

LEFT_OUT = "look_left_out"
"""The column that says what could not be worn, and why."""

Progress = Callable[[int], None]


@dataclass(frozen=True, eq=False)
class Pairs:
    """The pairs of one factor: in each, one image is plain and the other has the factor.

    subjects: [N] names, whose head it is. rotation: float64 [N, 3, 3], R_C of both.
    plain_ids, with_ids: [N] sample_ids. plain, varied: float64 [N, 8], DETECTOR of each; NaN where no face
    was found. not_made: pairs left out, since what should be worn could not be made.
    """

    factor: str
    subjects: np.ndarray
    rotation: np.ndarray
    plain_ids: list[str]
    with_ids: list[str]
    plain: np.ndarray
    varied: np.ndarray
    not_made: int = 0

    def __len__(self) -> int:
        return len(self.plain_ids)


@dataclass
class _Twins:
    """The twins of a factor, in the order in which they are read."""

    ids: list[str]
    bases: list[str]
    subjects: list[str]
    rotation: list[np.ndarray]
    measures: list[np.ndarray]
    twin_is_plain: list[bool]
    left_out: list[str]


def read_pairs(root: Path, progress: Progress = lambda rows: None) -> list[Pairs]:
    """Every pair of a dataset, factor by factor as the configuration names them.

    progress: called with the number of rows and twins read.

    Raises
    ------
    DatasetError: the dataset is not finished or damaged, or has no twins; a row of which there is a twin is
        missing.
    """
    manifest = read_manifest(root)
    if not manifest.twins:
        raise DatasetError(f"{root}: has no twins; build it with --twins, such as --twins light,lens")
    config, topology = known_config(manifest, root), dataset_topology(root, manifest)
    twins = _read_twins(root, manifest, config, topology, progress)
    wanted = {base for found in twins.values() for base in found.bases}
    rows = _read_rows(root, manifest, wanted, topology, progress)
    if lost := next((base for found in twins.values() for base in found.bases if base not in rows), None):
        raise DatasetError(f"{root}: the row {lost} has a twin and is missing; see `headturn verify`")
    order = [factor for factor in dict.fromkeys((*config.dataset.twins, *twins)) if factor in twins]
    return [_paired(factor, twins[factor], rows) for factor in order]


def _read_twins(
    root: Path, manifest: Manifest, config: BuildConfig, topology: Topology, progress: Progress
) -> dict[str, _Twins]:
    columns = [*COLUMNS, LEFT_OUT, "expression", "twin_of", "factor", *(f"{angle}_deg" for angle in ANGLES)]
    plain = _Plain(config)
    found: dict[str, _Twins] = {}
    for batch in read_rows(root, manifest.twins, columns):
        measures = detector_measures(batch, topology)
        rotation = as_array(batch, "rotation").reshape(-1, 3, 3)
        angles = np.stack([as_array(batch, f"{angle}_deg") for angle in ANGLES], axis=-1).tolist()
        names = ("factor", "sample_id", "twin_of", "subject", "expression", LEFT_OUT)
        texts = zip(*(batch.column(name).to_pylist() for name in names), strict=True)
        for row, (factor, name, base, subject, expression, left_out) in enumerate(texts):
            if factor not in FACTORS:
                raise DatasetError(f"{root}: {name} is a twin of no factor we know; see `headturn verify`")
            of_it = found.setdefault(factor, _Twins([], [], [], [], [], [], []))
            of_it.ids.append(name)
            of_it.bases.append(base)
            of_it.subjects.append(subject)
            of_it.rotation.append(rotation[row])
            of_it.measures.append(measures[row])
            of_it.left_out.append(left_out)
            of_it.twin_is_plain.append(
                not plain.is_row(factor, f"{subject}/{expression}", tuple(angles[row]))
            )
        progress(len(batch))
    return found


class _Plain:
    """Which rows are plain in a factor: the same for all where none of its settings is drawn."""

    def __init__(self, config: BuildConfig) -> None:
        self._config = config
        self._drawn = {
            name: any(f"render.{key}" in config.drawn for key in factor.draws)
            for name, factor in FACTORS.items()
        }

    def is_row(self, factor: str, head: str, pose: tuple[float, float, float]) -> bool:
        render = drawn_render(self._config, head, pose) if self._drawn[factor] else self._config.render
        return is_plain(render, FACTORS[factor])


def _read_rows(
    root: Path, manifest: Manifest, wanted: set[str], topology: Topology, progress: Progress
) -> dict[str, tuple[np.ndarray, str]]:
    """DETECTOR of the wanted rows, and what of their look could not be made."""
    found: dict[str, tuple[np.ndarray, str]] = {}
    for batch in read_rows(root, manifest.parts, [*COLUMNS, LEFT_OUT]):
        of_twins = np.array([name in wanted for name in batch.column("sample_id").to_pylist()], bool)
        progress(len(batch))
        if of_twins.any():
            some = batch.filter(pa.array(of_twins))
            measures = detector_measures(some, topology)
            names, left_out = (some.column(name).to_pylist() for name in ("sample_id", LEFT_OUT))
            found.update(zip(names, zip(measures, left_out, strict=True), strict=True))
    return found


def _paired(factor: str, twins: _Twins, rows: dict[str, tuple[np.ndarray, str]]) -> Pairs:
    of_row = [rows[name] for name in twins.bases]
    swapped = np.array(twins.twin_is_plain, bool)
    left_out = np.where(swapped, [text for _, text in of_row], twins.left_out)
    made = np.flatnonzero([not _lacks(text, factor) for text in left_out])
    base = np.array([measures for measures, _ in of_row]).reshape(-1, len(DETECTOR))
    twin = np.array(twins.measures).reshape(-1, len(DETECTOR))
    ids = np.array([twins.bases, twins.ids], dtype=object)
    plain_ids, with_ids = np.where(swapped, ids[::-1], ids)[:, made].tolist()
    return Pairs(
        factor,
        np.array(twins.subjects, dtype=object)[made],
        np.array(twins.rotation)[made],
        plain_ids,
        with_ids,
        np.where(swapped[:, None], twin, base)[made],
        np.where(swapped[:, None], base, twin)[made],
        len(swapped) - len(made),
    )


def _lacks(left_out: str, factor: str) -> bool:
    """Could what a factor puts on a head not be made? left_out: as the column has it."""
    return any(reason.startswith(f"{factor}: ") for reason in left_out.split("; "))


def rows_to_read(root: Path) -> int:
    """How many rows and twins :func:`read_pairs` reads. Raises DatasetError: the dataset is not finished."""
    manifest = read_manifest(root)
    return manifest.rows + sum(part.rows for part in manifest.twins)
