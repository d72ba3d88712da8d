# SPDX-License-Identifier: MIT
"""The face of the mean head in mm, which gives translations their scale."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

MEAN_HEAD = Path(__file__).parents[1] / "models" / "mean_head.csv"
"""Made by scripts/make_mean_head.py."""


@cache
def mean_head() -> np.ndarray:
    """float64 [468, 3], mm, frame C at pose zero. The origin is the pivot of the tables: on the axis between
    the ears, at eye height. Not to be written to."""
    points = np.loadtxt(MEAN_HEAD, delimiter=",", dtype=np.float64)
    points.setflags(write=False)
    return points
