# SPDX-License-Identifier: GPL-3.0-or-later
"""Two versions of one row, column by column, as the table of columns says."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from generator.dataset.format.columns import FURTHER, ROWS, Compare


@dataclass(frozen=True)
class StoredFile:
    """What a dataset holds of a row besides its values, as it is now.

    name: for people, such as images/a/neutral/y+0_p+0_r+0.png. sha256: what its column should say.
    detail: how far it is from the new one, such as ": up to 3 of 255 levels"; asked for only where
        they differ.
    """

    name: str
    sha256: str
    detail: Callable[[], str] = lambda: ""


def compared_columns(further: Iterable[str] = ()) -> dict[str, Compare]:
    """What replay compares, and how: column -> comparison, in the order of the table.

    further: columns of a row; those of further detectors are compared where they are there.
    """
    every = {**ROWS, **{name: FURTHER[name] for name in further if name in FURTHER}}
    return {name: column.replay for name, column in every.items() if column.replay is not None}


def row_differences(
    recorded: Mapping[str, Any], now: Mapping[str, Any], stored: Mapping[str, StoredFile] | None = None
) -> list[str]:
    """What differs between two rows as plain values, a line each.

    stored: the files whose hash a column holds, by its name; of those that are not there the recorded
        hash alone is compared.
    """
    lines = []
    for name, how in compared_columns(recorded).items():
        if stored and name in stored:
            line = _file_difference(how, stored[name], recorded[name], now[name])
        else:
            line = _difference(name, how, recorded[name], now[name])
        if line:
            lines.append(line)
    return lines


def _file_difference(how: Compare, file: StoredFile, then: str, now: str) -> str:
    """Which of three differs: the file, the hash in its row, or what is rendered now; "" if none."""
    if file.sha256 == then == now:
        return ""
    if file.sha256 == then:
        return how.says + file.detail()
    if then == now:
        return (
            f"{file.name} was changed after the build{file.detail()}; "
            "what is rendered now has the recorded hash"
        )
    if file.sha256 == now:
        return f"{file.name} is what is rendered now; the hash in its row is not its own and was changed"
    return (
        f"{file.name} has not the hash in its row, and what is rendered now has neither's{file.detail()}: "
        "file, row or both were changed"
    )


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
