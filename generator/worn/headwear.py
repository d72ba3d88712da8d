# SPDX-License-Identifier: GPL-3.0-or-later
"""What is on the head: hats around the hull of the skull and its hair, and scarves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from generator.heads.mesh import HeadMesh
from generator.plan.wear import OWN
from generator.worn.face import Face
from generator.worn.fit import Fit, Kind
from generator.worn.hats import beanie, brimmed, cap, hard_hat, headband
from generator.worn.scarf import scarf
from generator.worn.shapes import Part, assemble

OVER_HAIR_MM = 3.0
"""By how much hair that is worn, and flat, lifts a hat."""

STYLES: dict[str, Callable[[Face, np.random.Generator, float], list[Part]]] = {
    "cap": cap,
    "beanie": beanie,
    "brimmed": brimmed,
    "headscarf": scarf,
    "headband": headband,
    "hard-hat": hard_hat,
}


def make(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """See :data:`generator.worn.fit.Make`."""
    face = Face.of(fit)
    over = 0.0 if fit.others.get("hair", OWN) == OWN or style == "headscarf" else OVER_HAIR_MM
    return face.back(assemble(STYLES[style](face, rng, over)))


KIND = Kind(make, minds=("hair",))
