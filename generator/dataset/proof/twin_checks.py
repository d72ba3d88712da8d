# SPDX-License-Identifier: GPL-3.0-or-later
"""Proof of twins: each that is planned is there once, and differs from its row in its factor alone."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from generator.dataset.format.columns import FURTHER, LOOKS, ROWS, columns_at
from generator.dataset.format.dataset_poses import DatasetPoses
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import as_array, read_rows
from generator.dataset.format.schema import sample_id
from generator.dataset.proof.context import ExpectedView
from generator.dataset.proof.named import named
from generator.plan.config import BuildConfig
from generator.plan.factors import FACTORS, row_name
from generator.plan.twins import plan_twins, planned_twins, twin_factors
from generator.plan.views import View

TWINS = "twins"
"""The check of the report."""

_OWN = {
    *("sample_id", "image", "image_path", "image_sha256", "passes_path", "passes_sha256"),
    *("detected", "landmarks", *FURTHER),
}
"""Columns in which every twin may differ: its name, its files, and what is found on its image."""

_OF_CAMERA = {"camera", "translation_mm", "landmarks_exact", "landmarks_visible"}
_OF_WORN = {"landmarks_visible", "look_left_out"}

AT_HAND = 4096
"""Views of twins that are kept: several checks ask for the same."""


def may_differ(factor: str) -> set[str]:
    """The columns in which a twin may differ from its row."""
    known = FACTORS[factor]
    columns = {column for column, key in LOOKS.items() if key in known.settings}
    return _OWN | columns | (_OF_CAMERA if known.camera else set()) | (_OF_WORN if known.worn else set())


def must_differ(factor: str) -> set[str]:
    """The columns of a factor, of which a twin differs from its row in at least one."""
    known = FACTORS[factor]
    return {"camera"} if known.camera else {column for column, key in LOOKS.items() if key in known.draws}


class TwinPlan:
    """Which twins a dataset has to have, and those that were seen.

    factors: those that the configuration names. seen: uint8 [factors, heads, poses], how often.
    """

    def __init__(self, config: BuildConfig, heads: Sequence[HeadRow], poses: DatasetPoses) -> None:
        self._config, self._heads, self._poses = config, heads, poses
        self.factors = twin_factors(config)
        self.seen = np.zeros((len(self.factors), len(heads), poses.most if self.factors else 0), np.uint8)

    def add(self, factor: str, heads: np.ndarray, poses: np.ndarray) -> None:
        """Count twins by the places of their rows, int [N], none below 0."""
        np.add.at(self.seen[self.factors.index(factor)], (heads, poses), 1)

    @property
    def planned(self) -> np.ndarray:
        """Which there have to be, bool, as seen."""
        planned = np.zeros(self.seen.shape, bool)
        for place, head in enumerate(self._heads if self.factors else ()):
            poses = [(yaw, pitch, roll) for yaw, pitch, roll in self._poses.plan(place).angles_deg.tolist()]
            for factor, places in planned_twins(self._config, f"{head.subject}/{head.expression}", poses):
                planned[self.factors.index(factor), place, places] = True
        return planned

    def problems(self, failures: int) -> Iterator[str]:
        """Twins that are missing, not planned, or there more than once. failures: units that failed."""
        planned = self.planned
        missing = planned & (self.seen == 0)
        if failures and missing.any():
            yield f"{failures} units failed, see failures.jsonl"
        wrongs = ((missing, "is missing"), (~planned & (self.seen > 0), "is not in the plan"))
        for wrong, what in (*wrongs, (planned & (self.seen > 1), "is there more than once")):
            for factor, place, pose in np.argwhere(wrong).tolist():
                head = self._heads[place]
                name = row_name(self._poses.name(place, pose), self.factors[factor])
                yield f"{sample_id(head.subject, head.expression, name)} {what}"

    def views(self) -> Callable[[str], ExpectedView]:
        """Of a factor: the view that the twin of a row has to be."""

        @lru_cache(maxsize=AT_HAND)
        def view(factor: str, head: int, pose: int) -> View:
            row = self._heads[head]
            yaw, pitch, roll = self._poses.plan(head).angles_deg[pose].tolist()
            name = f"{row.subject}/{row.expression}"
            poses = [(yaw, pitch, roll)]
            return plan_twins(self._config, name, row.radius_mm, poses, factor, row.own_camera)[0]

        return lambda factor: lambda head, pose: view(factor, head, pose)


def twin_problems(batch: pa.RecordBatch, factor: str, root: Path, manifest: Manifest) -> Iterator[str]:
    """Twins with one factor changed against their rows, column by column.

    Raises DatasetError: the part of a row cannot be read.
    """
    names, bases = (batch.column(name).to_pylist() for name in ("sample_id", "twin_of"))
    for name, base in zip(names, bases, strict=True):
        if name != row_name(base, factor):
            yield f"{name}: twin_of is {base}, of which it is no twin"
    columns = [name for name in (*ROWS, *FURTHER) if name in batch.schema.names]
    heads = set(zip(*(batch.column(name).to_pylist() for name in ("subject", "expression")), strict=True))
    parts = [part for part in manifest.parts if not part.subject or (part.subject, part.expression) in heads]
    where = pc.field("sample_id").isin(bases)
    compared = [name for name in columns if name != "image"]
    found = [rows for rows in read_rows(root, parts, compared, where) if len(rows)]
    rows = pa.Table.from_batches(found) if found else None
    place = {} if rows is None else {name: k for k, name in enumerate(rows["sample_id"].to_pylist())}
    known = np.array([name in place for name in bases], bool)
    yield from named(batch, ~known, "the row of which it is the twin is not there")
    if rows is None or not known.any():
        return
    batch = batch.filter(pa.array(known))
    rows = rows.take(pa.array([place[name] for name in bases if name in place]))
    today = {column.name for column in columns_at(ROWS, manifest.schema_version)}
    differ = {name: _differ(batch, rows, name) for name in compared if name in today}
    free, changed = may_differ(factor), must_differ(factor)
    for name, differs in differ.items():
        if name not in free:
            yield from named(batch, differs, f"{name} differs from its row, and is not of {factor}")
    same = ~np.any([differ[name] for name in changed if name in differ], axis=0)
    yield from named(batch, same, f"nothing of {factor} differs from its row")


def _differ(one: pa.RecordBatch, other: pa.Table, name: str) -> np.ndarray:
    """bool [N]: in which rows a column differs; NaN equals NaN."""
    if pa.types.is_string(one.schema.field(name).type):
        pairs = zip(one.column(name).to_pylist(), other.column(name).to_pylist(), strict=True)
        return np.array([a != b for a, b in pairs], bool)
    a, b = as_array(one, name), as_array(other, name)
    same = a == b
    if a.dtype.kind == "f":
        same = same | (np.isnan(a) & np.isnan(b))
    return ~same.reshape(len(a), -1).all(axis=1)


def by_factor(batch: pa.RecordBatch) -> Iterable[tuple[str, np.ndarray]]:
    """Each factor of a batch and which rows have it, bool [N]."""
    factors = np.array(batch.column("factor").to_pylist(), dtype=object)
    return [(factor, factors == factor) for factor in dict.fromkeys(factors.tolist())]
