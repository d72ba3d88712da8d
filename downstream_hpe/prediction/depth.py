# SPDX-License-Identifier: MIT
"""Pictures of more than 8 bits a channel, made into 8."""

from __future__ import annotations

import numpy as np

from downstream_hpe.errors import DataError

WHOLE = (255, 1023, 4095, 65535)
"""White, of 8, 10, 12 or 16 bits. Files say 16 where a camera gave 10 or 12."""
HIGHLIGHT = 16.0
"""Floats up to this are of 0 to 1, with highlights; more are of 0 to 255, or to 65535."""


def from_whole(values: np.ndarray) -> np.ndarray:
    """uint8 of integers, of the fewest bits of WHOLE that hold the largest; if none does, that is white."""
    top = int(values.max(initial=0))
    white = next((white for white in WHOLE if top <= white), top)
    return np.rint(np.clip(values, 0, None) * (255.0 / white)).astype(np.uint8)


def from_floats(values: np.ndarray, linear: bool = False) -> np.ndarray:
    """uint8 of floats. linear: they are light, as in OpenEXR, and not what a screen is told (sRGB).

    DataError: none of them is finite.
    """
    finite = np.isfinite(values)
    if not finite.any():
        raise DataError("has no finite value")
    top = float(values[finite].max())
    values = np.nan_to_num(values.astype(np.float32), nan=0.0, posinf=top, neginf=0.0)
    if linear:
        # Half of the light is at most where sRGB has its middle grey, however bright it was.
        light = np.clip(values * min(1.0, 0.214 / max(float(np.median(values)), 1e-9)), 0, 1)
        shown = np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    else:
        white = 1.0 if top <= HIGHLIGHT else next((w for w in (255.0, 65535.0) if top <= w), top)
        shown = np.clip(values / white, 0, 1)
    return np.rint(255 * shown).astype(np.uint8)
