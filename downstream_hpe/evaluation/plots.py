# SPDX-License-Identifier: MIT
"""Evaluations as pictures: errors by interval, and how they are distributed."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from downstream_hpe.evaluation.scores import INTERVALS, Evaluation
from downstream_hpe.geometry.rotation import ANGLES

EMPTY: dict[str, Any] = {"facecolor": "0.97", "edgecolor": "0.8", "hatch": "///", "linewidth": 0}
"""An interval without rows."""
VALUE: dict[str, Any] = {"rotation": 90, "ha": "center", "fontsize": 8}
FAR = 3.0
"""So many times the second worst estimator's error is too much for one scale."""


def interval_figure(evaluations: Sequence[Evaluation]) -> Figure:
    """Mean |error| of each angle in its intervals, a bar an estimator, one panel an angle.

    Under every interval stands how many rows it has; one without any is hatched. A panel ends a little above
    its worst estimator or, where that is far worse than the others, as a constant answer is, above the
    second worst; a bar that goes beyond has its value on it.
    """
    figure = Figure(figsize=(13, 4.6), layout="constrained")
    width = 0.84 / len(evaluations)
    places = np.arange(INTERVALS)
    hatched = False
    for panel, angle in zip(figure.subplots(1, 3), ANGLES, strict=True):
        every = [[i for i in e.intervals if i.angle == angle] for e in evaluations]
        worst = sorted(max((i.mae for i in mine if i.count), default=0.0) for mine in every)
        second = worst[-2:][0]
        top = 1.15 * (second if 0 < FAR * second < worst[-1] else worst[-1]) or 1.0
        for n, (e, mine) in enumerate(zip(evaluations, every, strict=True)):
            at = places + (n - (len(evaluations) - 1) / 2) * width
            panel.bar(at, [i.mae for i in mine], width, label=e.name)
            for x, i in zip(at, mine, strict=True):
                if i.count and i.mae > top:
                    panel.text(x, 0.985 * top, f"{i.mae:.0f}", color="w", va="top", **VALUE)
                elif i.mae < 0.005 * top:
                    panel.text(x, 0.01 * top, "0", color="0.3", va="bottom", **VALUE)
        for place, i in zip(places, every[0], strict=True):
            if not i.count:
                panel.axvspan(place - 0.5, place + 0.5, **EMPTY)
                hatched = True
        edges = [f"{i.low:.3g}" for i in every[0]] + [f"{every[0][-1].high:.3g}"]
        panel.set_xticks(np.arange(INTERVALS + 1) - 0.5, edges)
        panel.set_xticks(places, [f"{i.count}" for i in every[0]], minor=True, color="0.4")
        panel.tick_params(axis="x", which="minor", length=0, pad=18)
        panel.set(xlabel=f"true {angle} (degrees); in grey: rows", title=angle)
        panel.set(xlim=(-0.5, INTERVALS - 0.5), ylim=(0, top))
        panel.grid(axis="y", alpha=0.3)
        panel.set_axisbelow(True)
    figure.axes[0].set_ylabel("mean error (degrees)")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    if hatched:
        handles, labels = [*handles, Patch(**EMPTY)], [*labels, "no rows"]
    figure.legend(handles, labels, loc="outside lower center", ncols=len(labels))
    return figure


def distribution_figure(evaluations: Sequence[Evaluation]) -> Figure:
    """The share of rows whose geodesic error is below a value, a curve an estimator."""
    figure = Figure(figsize=(5.5, 4), layout="constrained")
    panel = figure.subplots()
    for e in evaluations:
        panel.ecdf(e.geodesic_errors, label=e.name)
    panel.set(xlabel="geodesic error (degrees)", ylabel="share of rows", xlim=(0, 20), ylim=(0, 1))
    panel.grid(alpha=0.3)
    panel.legend(fontsize=8, loc="center right")
    return figure


def write_plots(evaluations: Sequence[Evaluation], folder: Path) -> None:
    """error_by_interval.png and error_distribution.png."""
    interval_figure(evaluations).savefig(folder / "error_by_interval.png", dpi=150)
    distribution_figure(evaluations).savefig(folder / "error_distribution.png", dpi=150)
