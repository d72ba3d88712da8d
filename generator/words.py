# SPDX-License-Identifier: GPL-3.0-or-later
"""Words for people that follow from numbers."""

from __future__ import annotations


def plural(count: int, noun: str) -> str:
    """A number and its noun: "1 head", "2 heads"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"
