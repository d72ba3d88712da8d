# SPDX-License-Identifier: GPL-3.0-or-later
"""Two versions of one row, column by column, as the table of columns says."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from generator.dataset.format.columns import ROWS, Compare


def compared_columns() -> dict[str, Compare]:
    """What replay compares, and how: column -> comparison, in the order of the table."""
    return {name: column.replay for name, column in ROWS.items() if column.replay is not None}


def row_differences(
    recorded: Mapping[str, Any], now: Mapping[str, Any], image_detail: Callable[[], str] = lambda: ""
) -> list[str]:
    """What differs between two rows as plain values, a line each.

    image_detail: how far the pictures are apart, such as ": up to 3 of 255 levels"; asked for only
        where their hashes differ.
    """
    lines = []
    for name, how in compared_columns().items():
        if line := _difference(name, how, recorded[name], now[name]):
            lines.append(line + (image_detail() if how.kind == "image" else ""))
    return lines


def _difference(name: str, how: Compare, then: Any, now: Any) -> str:
    """One line, or "" if there is no difference."""
    if how.kind == "floats":
        before, after = (np.array(values, dtype=np.float64) for values in (then, now))
        if np.array_equal(before, after, equal_nan=True):
            return ""
        off = np.abs(before - after) if before.shape == after.shape else np.empty(0)
        most = f": up to {np.nanmax(off):.3g} {how.unit}" if np.isfinite(off).any() else ""
        return f"{name} differ{most}"
    if then == now:
        return ""
    if how.kind == "flags":
        return f"{name} differ: {int(np.not_equal(then, now).sum())} of them"
    return how.says.format(name=name, then=then, now=now)
