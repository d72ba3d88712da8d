# SPDX-License-Identifier: GPL-3.0-or-later
"""What varies in a dataset, and in which part of its distribution a drawn value is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from statistics import NormalDist
from typing import Any

import numpy as np

from generator.plan.config import drawn_in
from generator.plan.distribution import PER_HEAD, Distribution
from generator.plan.setting import Setting
from generator.plan.settings import all_settings

NARROW, QUARTERS = 20, 4
"""Bins of a histogram; parts of a distribution of which each is as likely."""

MOST = 12
"""Choices that have a bin each; what else there is shares one."""

REACH_SD = 3.0
"""How far the histogram of a normal distribution goes."""

NUMBERS = {"background": ("red", "green", "blue")}
"""What the numbers of a setting are, where it has several."""


@dataclass(frozen=True)
class Bins:
    """Parts of what may be drawn.

    names: of each, for people. edges: float64, between those of numbers. values: of texts, in the order of
    names; those beyond them share the last.
    """

    names: tuple[str, ...]
    edges: np.ndarray | None = None
    values: tuple[str, ...] = ()

    def __len__(self) -> int:
        return len(self.names)

    def place(self, drawn: np.ndarray) -> np.ndarray:
        """The bin of each value, int64 [N]; -1 of what is none of them, such as NaN."""
        if self.edges is not None:
            return np.where(np.isnan(drawn), -1, np.searchsorted(self.edges, drawn, side="right"))
        last = len(self) - 1
        known = {value: min(k, last) for k, value in enumerate(self.values)}
        return np.array([known.get(value, -1) for value in drawn.tolist()], np.int64)


@dataclass(frozen=True)
class Factor:
    """A setting that is drawn. place: which of its numbers, where it has several."""

    setting: Setting
    distribution: Distribution
    place: int | None = None

    @property
    def name(self) -> str:
        """As in a configuration, such as "distance_mm" or "background, red"."""
        if self.place is None:
            return self.setting.key
        return f"{self.setting.key}, {NUMBERS.get(self.setting.key, range(1, 99))[self.place]}"

    @property
    def drawn_from(self) -> str:
        """Its distribution, for people: what is chosen several times is said once, with how often."""
        distribution = self.distribution
        if distribution.kind != "choice":
            return distribution.text
        times = Counter(distribution.texts or map(shown, distribution.numbers))
        choices = ", ".join(name if n == 1 else f"{name} ×{n}" for name, n in times.items())
        return f"{PER_HEAD if distribution.per_head else ''}choice: {choices}"

    @property
    def narrow(self) -> Bins:
        """The bins of its histogram."""
        kind, (low, high) = self.distribution.kind, self._ends
        if kind == "choice" or low == high:
            return self._choices
        spaced = np.geomspace if kind == "log-uniform" else np.linspace
        return _between(spaced(low, high, NARROW + 1))

    @property
    def parts(self) -> Bins:
        """Its quarters, or its choices."""
        kind, (low, high) = self.distribution.kind, self._ends
        if kind == "choice" or low == high:
            return self._choices
        if kind == "normal":
            bell = NormalDist(*self.distribution.numbers)
            inner = [bell.inv_cdf(k / QUARTERS) for k in range(1, QUARTERS)]
            return _between(np.array([low, *np.clip(inner, low, high), high]))
        spaced = np.geomspace if kind == "log-uniform" else np.linspace
        return _between(spaced(low, high, QUARTERS + 1))

    @property
    def _ends(self) -> tuple[float, float]:
        """Of a histogram."""
        if self.distribution.texts:
            return 0.0, 0.0
        first, second = self.distribution.numbers[0], self.distribution.numbers[-1]
        if self.distribution.kind != "normal":
            return first, second
        low, high = self.distribution.low, self.distribution.high
        ends = first - REACH_SD * second, first + REACH_SD * second
        return max(ends[0], -np.inf if low is None else low), min(ends[1], np.inf if high is None else high)

    @property
    def _choices(self) -> Bins:
        texts = tuple(dict.fromkeys(self.distribution.texts))
        numbers = np.unique(self.distribution.numbers)
        names = texts or tuple(map(shown, numbers.tolist()))
        if len(names) > MOST:
            names = (*names[: MOST - 1], f"{len(names) - MOST + 1} others")
        if texts:
            return Bins(names, values=texts)
        # What a camera tells of a number has an error of rounding: the nearest one it is.
        return Bins(names, ((numbers[1:] + numbers[:-1]) / 2)[: len(names) - 1])


def factors_of(configuration: Mapping[str, Any]) -> list[Factor]:
    """What the configuration of a dataset draws, in the order of the settings.

    Raises UsageError: it holds something that is no distribution where one may stand.
    """
    known = {setting.name: setting for setting in all_settings()}
    found = []
    for name, distribution in drawn_in(configuration, "manifest.json").items():
        section, key, *place = name.split(".")
        found.append(Factor(known[f"{section}.{key}"], distribution, int(place[0]) if place else None))
    return found


def shown(value: float) -> str:
    """A number for people."""
    return f"{value:.3g}" if abs(value) < 1000 else f"{value:.0f}"


def _between(edges: np.ndarray) -> Bins:
    """The bins between edges; the first and the last one have no end."""
    names = tuple(f"{shown(a)} to {shown(b)}" for a, b in pairwise(edges.tolist()))
    return Bins(names, edges[1:-1])
