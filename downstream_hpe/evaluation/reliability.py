# SPDX-License-Identifier: MIT
"""What a confidence was worth: what was said beside what came true."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from downstream_hpe.geometry.metrics import SURE_DEG


def reliability(confidence: np.ndarray, errors_deg: np.ndarray, edges: Sequence[float] | None = None) -> str:
    """A Markdown table: what was said, and what came true, a row an interval of confidence.

    confidence: float [N]. errors_deg: geodesic errors, float [N].
    """
    bins = np.asarray(edges if edges is not None else (0, 0.1, 0.25, 0.5, 0.75, 0.9, 1))
    lines = [
        f"| confidence | rows | mean confidence | share below {SURE_DEG:g}° | mean geodesic |",
        "| --- | ---: | ---: | ---: | ---: |",
    ]
    place = np.clip(np.searchsorted(bins, confidence, side="right") - 1, 0, len(bins) - 2)
    for k in range(len(bins) - 1):
        mine = place == k
        if mine.any():
            sure = (errors_deg[mine] < SURE_DEG).mean()
            lines.append(
                f"| {bins[k]:g} to {bins[k + 1]:g} | {mine.sum()} | {confidence[mine].mean():.2f} "
                f"| {sure:.2f} | {errors_deg[mine].mean():.2f} |"
            )
    return "\n".join(lines) + "\n"
