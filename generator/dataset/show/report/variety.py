# SPDX-License-Identifier: GPL-3.0-or-later
"""What varies, on the page: how often each value was drawn, how many faces were found, and images of each."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import as_array, read_rows, read_samples
from generator.dataset.show.drawn_values import DrawnValues
from generator.dataset.show.factors import Bins, Factor, factors_of
from generator.dataset.show.report.tiles import picture_uri
from generator.plan.poses import ANGLES

SHOWN, SHOWN_PX = 2, 96
"""Images of each part of a distribution, and their side in pixels."""

_COLUMNS = ["sample_id", "detected", *(f"{angle}_deg" for angle in ANGLES)]


class Counted:
    """Rows of one factor, counted. rows, found: int64 [bins]."""

    def __init__(self, bins: Bins) -> None:
        self.bins = bins
        self.rows, self.found = (np.zeros(len(bins), np.int64) for _ in range(2))

    def add(self, place: np.ndarray, detected: np.ndarray) -> None:
        """place: int64 [N], the bin of each row. detected: bool [N]."""
        there = place >= 0
        np.add.at(self.rows, place[there], 1)
        np.add.at(self.found, place[there], detected[there])

    def as_dict(self) -> dict[str, Any]:
        """For the page."""
        return {"names": list(self.bins.names), "rows": self.rows.tolist(), "found": self.found.tolist()}


class Examples:
    """The rows nearest to the front of each part of a distribution, found ones and missed ones."""

    def __init__(self, parts: int) -> None:
        self._kept: list[list[list[tuple[float, str]]]] = [[[], []] for _ in range(parts)]

    def add(self, place: np.ndarray, detected: np.ndarray, turn: np.ndarray, names: Sequence[str]) -> None:
        """turn: float64 [N], how far from the front. names: sample_id."""
        for part, kinds in enumerate(self._kept):
            for kind, kept in enumerate(kinds):
                rows = np.flatnonzero((place == part) & (detected == bool(kind)))
                nearest = rows[np.argsort(turn[rows], kind="stable")[:SHOWN]].tolist()
                kinds[kind] = sorted([*kept, *((float(turn[row]), names[row]) for row in nearest)])[:SHOWN]

    def chosen(self, part: int) -> list[str]:
        """Sample ids: one that was missed, if there is one, and else found ones."""
        missed, found = ([name for _, name in kept] for kept in self._kept[part])
        return [*found[: SHOWN - 1], *missed[:1], *found[SHOWN - 1 :], *missed[1:]][:SHOWN]


def collect_variety(root: Path, manifest: Manifest, heads: Sequence[HeadRow]) -> dict[str, Any] | None:
    """What the page shows of it; None where nothing varies. Reads the rows once.

    Raises DatasetError: a part or an image is missing or damaged. UsageError: the recorded configuration
    holds no distribution where it says one.
    """
    drawn = DrawnValues(factors_of(manifest.configuration), heads, manifest.configuration)
    if not drawn.factors:
        return None
    histograms = [Counted(one.narrow) for one in drawn.factors]
    parts = [Counted(one.parts) for one in drawn.factors]
    examples = [Examples(len(part.bins)) for part in parts]
    for batch in read_rows(root, manifest.parts, [*dict.fromkeys([*_COLUMNS, *drawn.columns])]):
        _add(batch, drawn.of(batch), histograms, parts, examples)
    factors = [
        {
            **_words(factor),
            "histogram": histogram.as_dict(),
            "parts": part.as_dict(),
            "examples": [example.chosen(k) for k in range(len(part.bins))],
        }
        for factor, histogram, part, example in zip(drawn.factors, histograms, parts, examples, strict=True)
    ]
    names = {name for factor in factors for part in factor["examples"] for name in part}
    return {"factors": factors, "tiles": _tiles(root, manifest, sorted(names))}


def _add(
    batch: pa.RecordBatch,
    values: Sequence[np.ndarray],
    histograms: Sequence[Counted],
    parts: Sequence[Counted],
    examples: Sequence[Examples],
) -> None:
    detected = as_array(batch, "detected").astype(bool)
    turn = np.sqrt(sum(as_array(batch, f"{angle}_deg") ** 2 for angle in ANGLES))
    names = batch.column("sample_id").to_pylist()
    for drawn, histogram, part, example in zip(values, histograms, parts, examples, strict=True):
        histogram.add(histogram.bins.place(drawn), detected)
        place = part.bins.place(drawn)
        part.add(place, detected)
        example.add(place, detected, turn, names)


def _words(factor: Factor) -> dict[str, Any]:
    return {
        "name": factor.name,
        "unit": factor.setting.info.unit,
        "help": factor.setting.info.help,
        "drawn": factor.drawn_from,
        "whose": "head" if factor.distribution.per_head else "image",
    }


def _tiles(root: Path, manifest: Manifest, names: Sequence[str]) -> dict[str, dict[str, Any]]:
    """The images of some rows by their sample_id; none of a dataset without images."""
    if manifest.images == "none":
        return {}
    rows = read_samples(root, manifest, names)
    return {
        name: {"src": picture_uri(root, row, SHOWN_PX), "detected": row["detected"]}
        for name, row in sorted(rows.items())
    }
