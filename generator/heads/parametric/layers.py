# SPDX-License-Identifier: GPL-3.0-or-later
"""Layers of paint on a picture float32 [3, N]: a plane a colour, so that few texels are touched quickly."""

from __future__ import annotations

import numpy as np


def lay(color: np.ndarray, where: np.ndarray, paint: np.ndarray, alpha: np.ndarray) -> None:
    """Paint over color [3, N] in place, at texels where [K]. paint: [3] or [3, K]; alpha: [K], 0-1."""
    for plane, value in zip(color, np.asarray(paint, dtype=np.float32), strict=True):
        below = plane[where]
        below += (value - below) * alpha
        plane[where] = below


def put(color: np.ndarray, where: np.ndarray, paint: np.ndarray) -> None:
    """Replace color [3, N] in place, at texels where [K]. paint: [3, K]."""
    for plane, value in zip(color, paint, strict=True):
        plane[where] = value


def darken(color: np.ndarray, where: np.ndarray, amount: np.ndarray, channels: tuple[float, ...]) -> None:
    """Take amount [K] times a share for each channel off color [3, N] in place, at texels where [K]."""
    for plane, share in zip(color, channels, strict=True):
        plane[where] *= 1 - np.float32(share) * amount


def mix(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Colours [3, K], float32: first [3] where share [K] is 0, second [3] where it is 1."""
    a, b = np.asarray(first, dtype=np.float32)[:, None], np.asarray(second, dtype=np.float32)[:, None]
    mixed: np.ndarray = a + (b - a) * share
    return mixed
