# SPDX-License-Identifier: GPL-3.0-or-later
"""Small panoramas with known light, and files of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR

SMALL = (32, 64)


def even(value: float = 1.0) -> np.ndarray:
    """The same light from everywhere."""
    return np.full((*SMALL, 3), value, np.float32)


def from_the_right(power: float = 40.0) -> np.ndarray:
    """A little light from everywhere, and a lamp at +x, between the middle and the right end."""
    light = even(0.05)
    light[14:18, 46:50] = power
    return light


def write_exr(path: Path, light: np.ndarray) -> Path:
    """A panorama as an OpenEXR."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    channels = {name: np.ascontiguousarray(light[..., k]) for k, name in enumerate("RGB")}
    with OpenEXR.File(header, channels) as file:
        file.write(str(path))
    return path
