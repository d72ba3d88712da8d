# SPDX-License-Identifier: GPL-3.0-or-later
"""Randomness that depends on what is drawn alone: not on what else is drawn, in what order, by whom."""

from __future__ import annotations

import hashlib

Seed = int | tuple[int, ...]
"""What numpy makes a generator from."""


def draw_seed(seed: int, *names: str) -> tuple[int, ...]:
    """The seed of one draw. names: what is drawn and for what, such as ("poses", subject, expression)."""
    text = "\0".join(names).encode()
    return seed, int.from_bytes(hashlib.sha256(text).digest()[:8], "big")


def person_of(head: str) -> str:
    """The subject of subject/expression, on whom depends what does not change with an expression."""
    return head.rpartition("/")[0] or head
