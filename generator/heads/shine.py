# SPDX-License-Identifier: GPL-3.0-or-later
"""How much the surfaces of a head shine. stdlib only: the render worker reads it."""

from __future__ import annotations

import re

from generator.heads.mesh import Material
from generator.labels import EYES, LIPS, SKIN, TEETH

WET = {EYES: 0.9, TEETH: 0.75}
"""Gloss of what is never dry."""

LIPS_MORE = 0.15
"""How much glossier lips are than skin."""

_NAMES = (
    (None, re.compile(r"lash|brow|hair|beard", re.IGNORECASE)),
    (EYES, re.compile(r"eye(?!.?lid)|cornea|sclera|iris", re.IGNORECASE)),
    (TEETH, re.compile(r"teeth|tooth|tongue|gum|mouth", re.IGNORECASE)),
    (LIPS, re.compile(r"lips?\b", re.IGNORECASE)),
)


def gloss_of(material: Material, skin: float) -> float:
    """0 (matt) to 1 of a material where the skin has so much: its own, if it has one.

    Materials of meshes say what they are by their names alone; what no name tells is skin.
    """
    if material.gloss or not skin:
        return material.gloss
    what = _what(material)
    if what in WET:
        return WET[what]
    return {SKIN: skin, LIPS: min(1.0, skin + LIPS_MORE)}.get(what, 0.0)


def _what(material: Material) -> str:
    if material.label != SKIN:
        return material.label
    return next((what or "" for what, names in _NAMES if names.search(material.name)), SKIN)
