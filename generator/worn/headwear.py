# SPDX-License-Identifier: GPL-3.0-or-later
"""What is on the head: hats around the hull of the skull and its hair, and scarves."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from generator.heads.mesh import HeadMesh
from generator.worn.face import Face
from generator.worn.fit import Fit, Kind
from generator.worn.hats import beanie, brimmed, cap, hard_hat, headband
from generator.worn.scarf import scarf
from generator.worn.shapes import Part, assemble

STYLES: dict[str, Callable[[Face, np.random.Generator], list[Part]]] = {
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
    return face.back(assemble(STYLES[style](face, rng)))


KIND = Kind(make)
