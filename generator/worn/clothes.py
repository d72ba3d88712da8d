# SPDX-License-Identifier: GPL-3.0-or-later
"""Clothes: a neck that joins the head's own, shoulders, and what they wear."""

from __future__ import annotations

import numpy as np

from generator.heads.mesh import HeadMesh, Material
from generator.labels import CLOTHES, SKIN
from generator.worn.complexion import complexion
from generator.worn.fit import Fit, Kind
from generator.worn.garments import GARMENTS
from generator.worn.skull import without_hair
from generator.worn.strips import join, worn_mesh
from generator.worn.torso import find_torso

BELOW_MM = 45.0
"""How far the neck goes on below where a collar lies."""


def make(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """Clothes of a style. Raises CannotWear if a landmark is missing."""
    torso = find_torso(without_hair(fit))
    look = complexion(torso.fit)
    cloth = join(GARMENTS[style](torso, rng))
    skin = torso.skin(look, BELOW_MM)
    return worn_mesh(
        (Material("worn clothes", tuple(cloth.colors.mean(axis=0).tolist()), label=CLOTHES), cloth),
        (Material("worn neck", tuple(look.neck.tolist()), label=SKIN), skin),
    )


KIND = Kind(make)
