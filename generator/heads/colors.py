# SPDX-License-Identifier: GPL-3.0-or-later
"""Vertex colours as files write them: 0-1 or 0-255."""

from __future__ import annotations

import numpy as np

from generator.errors import HeadError


def unit_colors(values: np.ndarray) -> np.ndarray:
    """Colours 0-1, float32 [N, 3], of numbers in one of the two ranges in which floats are found.

    A little above 1 is rounding or light that is brighter than white, not 0-255 in which all is black;
    whole numbers, which 0-1 would leave nothing but on and off, are 0-255 from 2 on.

    Raises
    ------
    HeadError: a number is not finite, or beyond both ranges.
    """
    if not np.isfinite(values).all():
        raise HeadError("a vertex colour is not a finite number; export the mesh again")
    highest = values.max(initial=0.0)
    if highest > 256:
        raise HeadError(f"a vertex colour is {highest:g}; write them as 0-1 or as 0-255")
    whole = highest > 1 and bool((values == np.round(values)).all())
    return np.clip(values / (255.0 if whole or highest > 2 else 1.0), 0, 1).astype(np.float32)
