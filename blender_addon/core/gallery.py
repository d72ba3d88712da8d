# SPDX-License-Identifier: GPL-3.0-or-later
"""Which heads of a source have their picture shown: a window around the one in view."""

from __future__ import annotations

from collections.abc import Sequence

from .found import HeadName

AROUND = 50
"""How many heads before and after the shown one have their picture made: a source may hold thousands."""


def place_of(heads: Sequence[HeadName], head: HeadName) -> int:
    """Which of the heads it is; the first if it is none of them."""
    return heads.index(head) if head in heads else 0


def window(heads: Sequence[HeadName], head: HeadName) -> range:
    """Places of the heads around one of them, in the source's order."""
    middle = place_of(heads, head)
    return range(max(0, middle - AROUND), min(len(heads), middle + AROUND + 1))


def nearest(heads: Sequence[HeadName], head: HeadName) -> list[HeadName]:
    """The heads of the window, the nearest first."""
    middle = place_of(heads, head)
    return [heads[place] for place in sorted(window(heads, head), key=lambda place: abs(place - middle))]


def titles(heads: Sequence[HeadName]) -> list[str]:
    """What stands below each picture: the expression only where there are several."""
    several = len({expression for _, expression in heads}) > 1
    return [f"{subject} {expression}" if several else subject for subject, expression in heads]
