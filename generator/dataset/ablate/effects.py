# SPDX-License-Identifier: GPL-3.0-or-later
"""The effect of a factor on a measure: mean without it, with it, and the change with its interval."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

LEVEL = 0.95
RESAMPLES = 2000
FEWEST = 2
"""Identities below which nothing can be resampled."""


@dataclass(frozen=True)
class Effect:
    """What a factor does to a measure, over pairs.

    pairs: in which both images have a value. plain, varied: means without and with the factor. change: their
    difference; low, high: its interval. NaN where there are no pairs, or too few identities.
    """

    measure: str
    unit: str
    pairs: int
    plain: float
    varied: float
    change: float
    low: float
    high: float

    @property
    def is_sure(self) -> bool:
        """Does the interval leave out zero?"""
        return bool(self.low > 0 or self.high < 0)


def effect(
    measure: str, unit: str, subjects: np.ndarray, plain: np.ndarray, varied: np.ndarray, seed: int = 0
) -> Effect:
    """The effect over pairs, float [N] each; pairs with NaN are left out.

    Images of one person are no independent draws, so whole identities are resampled (a paired bootstrap over
    clusters): the interval is about people who are not in the dataset.
    """
    both = np.isfinite(plain) & np.isfinite(varied)
    if not both.any():
        return Effect(measure, unit, 0, *[float("nan")] * 5)
    a, b = plain[both], varied[both]
    low, high = mean_interval(subjects[both], b - a, seed)
    change = float((b - a).mean())
    return Effect(measure, unit, int(both.sum()), float(a.mean()), float(b.mean()), change, low, high)


def mean_interval(subjects: np.ndarray, values: np.ndarray, seed: int = 0) -> tuple[float, float]:
    """The LEVEL interval of the mean of values: percentiles of resampled subjects. NaN below FEWEST."""
    from scipy.stats import bootstrap  # which takes half a second to import

    _, of_value = np.unique(subjects.astype(str), return_inverse=True)
    sums, counts = np.bincount(of_value, values), np.bincount(of_value)
    if len(sums) < FEWEST:
        return float("nan"), float("nan")

    def mean(sums: np.ndarray, counts: np.ndarray, axis: int = -1) -> np.ndarray:
        return sums.sum(axis=axis) / counts.sum(axis=axis)

    found = bootstrap(
        (sums, counts),
        mean,
        n_resamples=RESAMPLES,
        paired=True,
        vectorized=True,
        confidence_level=LEVEL,
        method="percentile",
        random_state=np.random.default_rng(seed),
    ).confidence_interval
    return float(found.low), float(found.high)
