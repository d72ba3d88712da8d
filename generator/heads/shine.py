# SPDX-License-Identifier: GPL-3.0-or-later
"""How much the surfaces of a head shine. The render worker reads it."""

from __future__ import annotations

from generator.heads.mesh import Material
from generator.labels import CLOTHES, EYES, GLASSES, HAIR, HEADWEAR, MASK, OCCLUDER, SKIN, TEETH, named

WET = {EYES: 0.9, TEETH: 0.75}
"""Gloss of what is never dry."""

WORN = frozenset({HAIR, GLASSES, HEADWEAR, CLOTHES, MASK, OCCLUDER})
"""What is put on a head says itself how much it shines."""

Kind = float | str
"""What decides a gloss: a material's own, or the class that it is of."""


Kinds = tuple[Kind, ...]
"""Those of all materials of a mesh, each once."""


def is_skin(material: Material) -> bool:
    """Is it a head's skin, all or some of it?"""
    return material.label not in WORN and named(material.name) == SKIN


def kind_of_gloss(material: Material) -> Kind:
    """A material's own gloss, if it has one, SKIN, one of WET, or 0.

    A head's materials say what they are by their names, whatever labels they have where somebody asked for
    the pass segmentation, which changes no picture.
    """
    if material.gloss or material.label in WORN:
        return material.gloss
    what = named(material.name)
    return what if what == SKIN or what in WET else 0.0


def gloss_of(kind: Kind, skin: float) -> float:
    """0 (matt) to 1 of a kind where the skin has so much."""
    if isinstance(kind, str):
        return skin and WET.get(kind, skin)
    return kind
