# SPDX-License-Identifier: GPL-3.0-or-later
"""What a surface is: the classes of the pass ``segmentation``. stdlib only: the render worker reads it."""

from __future__ import annotations

LABELS = (
    "skin", "hair", "brows", "beard", "eyes", "lips", "teeth", "glasses", "headwear", "clothes", "mask",
    "occluder",
)  # fmt: skip
"""Every class but the background, which is what none of them covers. Headphones are headwear."""

SKIN, HAIR, BROWS, BEARD, EYES, LIPS, TEETH, GLASSES, HEADWEAR, CLOTHES, MASK, OCCLUDER = LABELS
