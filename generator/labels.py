# SPDX-License-Identifier: GPL-3.0-or-later
"""What a surface is: the classes of the pass ``segmentation``. stdlib only: the render worker reads it."""

from __future__ import annotations

import re

LABELS = (
    "skin", "hair", "brows", "beard", "eyes", "lips", "teeth", "glasses", "headwear", "clothes", "mask",
    "occluder",
)  # fmt: skip
"""Every class but the background, which is what none of them covers. Headphones are headwear."""

SKIN, HAIR, BROWS, BEARD, EYES, LIPS, TEETH, GLASSES, HEADWEAR, CLOTHES, MASK, OCCLUDER = LABELS

_NAMES = (
    (BROWS, r"brow|lash"),
    (BEARD, r"beard|moustache|mustache"),
    (EYES, r"eye(?!brow|lash|lid)|cornea|iris|sclera|pupil"),
    (TEETH, r"teeth|tooth|tongue|gum|mouth"),
    (GLASSES, r"glasses|spectacles"),
    (HAIR, r"hair|scalp"),
    (HEADWEAR, r"hat\b|cap\b|helmet"),
    (CLOTHES, r"cloth|shirt|suit|collar|top\b|dress"),
)
"""Words in the name of a material, the first that is there."""


def named(material: str) -> str:
    """What a material is by its name; skin, where that does not say."""
    return next((label for label, words in _NAMES if re.search(words, material.lower())), SKIN)
