# SPDX-License-Identifier: GPL-3.0-or-later
"""The ablation of a dataset: every factor, what it does to the detector and to a model."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from generator.dataset.ablate.effects import LEVEL, RESAMPLES, Effect, effect
from generator.dataset.ablate.measures import DETECTOR, POSE, Measure, model_measures
from generator.dataset.ablate.pairs import Pairs, Progress, read_pairs
from generator.dataset.ablate.predictions import Predictions
from generator.escape import csv_text
from generator.plan.factors import FACTORS

ABLATION_FILE = "ablation.csv"
CSV_COLUMNS = (
    *("factor", "estimator", "measure", "unit", "pairs", "identities", "missed"),
    *("plain", "with", "change", "low", "high"),
)
FOUND = Measure("found", "share of the images on which a face was found", "%")


@dataclass(frozen=True)
class Judged:
    """A factor as one estimator sees it: the detector with a rigid fit, or a model.

    found_neither, found_plain, found_with: pairs in which it found a face on none of the two images, only on
    the plain one, only on the one with the factor; in the others on both. effects: FOUND over all pairs, the
    rest over those with a face on both.
    """

    estimator: str
    found_neither: int
    found_plain: int
    found_with: int
    effects: tuple[Effect, ...]

    @property
    def missed(self) -> int:
        """Pairs that say nothing of landmarks and pose: a face was missed."""
        return self.found_neither + self.found_plain + self.found_with

    def of(self, measure: str) -> Effect:
        """The effect on one measure."""
        return next(one for one in self.effects if one.measure == measure)


@dataclass(frozen=True)
class FactorEffects:
    """One factor. identities: of the pairs. not_made: pairs in which nobody wears what should be worn."""

    factor: str
    pairs: int
    identities: int
    judged: tuple[Judged, ...]
    not_made: int = 0


@dataclass(frozen=True)
class Ablation:
    """Every factor of a dataset. seed: of the resampling."""

    factors: tuple[FactorEffects, ...]
    seed: int = 0

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON; null where there is no number."""
        return {
            "level": LEVEL,
            "resamples": RESAMPLES,
            "seed": self.seed,
            "factors": [
                {
                    "factor": one.factor,
                    "meaning": FACTORS[one.factor].meaning,
                    "pairs": one.pairs,
                    "identities": one.identities,
                    "not_made": one.not_made,
                    "judged": [_judged_dict(judged) for judged in one.judged],
                }
                for one in self.factors
            ],
        }

    def as_csv(self) -> str:
        """A line for each factor, estimator and measure."""
        file = io.StringIO()
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(CSV_COLUMNS)
        for one in self.factors:
            for judged in one.judged:
                for found in judged.effects:
                    numbers = (found.plain, found.varied, found.change, found.low, found.high)
                    writer.writerow(
                        (
                            *(one.factor, csv_text(judged.estimator), found.measure, found.unit),
                            *(found.pairs, one.identities, judged.missed),
                            *("" if math.isnan(number) else f"{number:.6g}" for number in numbers),
                        )
                    )
        return file.getvalue()


def ablate_dataset(
    root: Path,
    predictions: Sequence[Predictions] = (),
    *,
    seed: int = 0,
    progress: Progress = lambda rows: None,
) -> Ablation:
    """What every factor does.

    predictions: of models besides. seed: of the resampling of identities.
    Raises DatasetError as :func:`generator.dataset.ablate.pairs.read_pairs`; UsageError: predictions lack
    some rows.
    """
    return ablation_of(read_pairs(root, progress), predictions, seed)


def ablation_of(every: Sequence[Pairs], predictions: Sequence[Predictions] = (), seed: int = 0) -> Ablation:
    """The same of pairs that were read. Raises UsageError: predictions lack some rows."""
    return Ablation(tuple(_effects(pairs, predictions, seed) for pairs in every), seed)


def _effects(pairs: Pairs, predictions: Sequence[Predictions], seed: int) -> FactorEffects:
    judged = [_judged("detector", DETECTOR, pairs.subjects, pairs.plain, pairs.varied, seed)]
    for model in predictions:
        plain, varied = (
            model_measures(model.of(ids), pairs.rotation) for ids in (pairs.plain_ids, pairs.with_ids)
        )
        judged.append(_judged(model.path.stem, POSE, pairs.subjects, plain, varied, seed))
    identities = len(set(pairs.subjects.tolist()))
    return FactorEffects(pairs.factor, len(pairs), identities, tuple(judged), pairs.not_made)


def _judged(
    estimator: str,
    measures: Sequence[Measure],
    subjects: np.ndarray,
    plain: np.ndarray,
    varied: np.ndarray,
    seed: int,
) -> Judged:
    """plain, varied: float [N, measures]; NaN where no face was found."""
    # By the pose, which is there wherever a face was: landmarks are none of a head without anchors.
    at = [measure.name for measure in measures].index("geodesic")
    a, b = np.isfinite(plain[:, at]), np.isfinite(varied[:, at])
    effects = [effect(FOUND.name, FOUND.unit, subjects, 100.0 * a, 100.0 * b, seed)]
    effects += [
        effect(measure.name, measure.unit, subjects, plain[:, k], varied[:, k], seed)
        for k, measure in enumerate(measures)
    ]
    counts = (int((~a & ~b).sum()), int((a & ~b).sum()), int((~a & b).sum()))
    return Judged(estimator, *counts, tuple(effects))


def _judged_dict(judged: Judged) -> dict[str, Any]:
    return {
        "estimator": judged.estimator,
        "found_neither": judged.found_neither,
        "found_plain": judged.found_plain,
        "found_with": judged.found_with,
        "effects": [
            {
                {"varied": "with"}.get(name, name): None if value != value else value
                for name, value in asdict(found).items()
            }
            for found in judged.effects
        ],
    }
