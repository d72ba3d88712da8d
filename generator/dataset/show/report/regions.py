# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of the face among the 468 points, as MediaPipe's own connection lists draw them."""

from __future__ import annotations

import numpy as np

from generator.dataset.format.schema import LANDMARKS

_EYES = (
    33, 7, 163, 144, 145, 153, 154, 155, 133, 246, 161, 160, 159, 158, 157, 173,
    263, 249, 390, 373, 374, 380, 381, 382, 362, 466, 388, 387, 386, 385, 384, 398,
)  # fmt: skip
_BROWS = (46, 53, 52, 65, 55, 70, 63, 105, 66, 107, 276, 283, 282, 295, 285, 300, 293, 334, 296, 336)
_NOSE = (
    168, 6, 197, 195, 5, 4, 45, 220, 115, 48, 275, 440, 344, 278, 1, 19, 94, 2, 98, 97, 326, 327, 64, 294,
)  # fmt: skip
_MOUTH = (
    61, 146, 91, 181, 84, 17, 314, 405, 321, 375, 291, 185, 40, 39, 37, 0, 267, 269, 270, 409,
    78, 95, 88, 178, 87, 14, 317, 402, 318, 324, 308, 191, 80, 81, 82, 13, 312, 311, 310, 415,
)  # fmt: skip
_OVAL = (
    10, 338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365, 379, 378, 400, 377, 152, 148,
    176, 149, 150, 136, 172, 58, 132, 93, 234, 127, 162, 21, 54, 103, 67, 109,
)  # fmt: skip

REGIONS: dict[str, np.ndarray] = {
    "whole face": np.arange(LANDMARKS),
    "eyes": np.array(_EYES),
    "brows": np.array(_BROWS),
    "nose": np.array(_NOSE),
    "mouth": np.array(_MOUTH),
    "jaw and oval": np.array(_OVAL),
}
"""Name of a part -> places of its points, int64 [k]. Cheeks and forehead count for the whole face only."""
