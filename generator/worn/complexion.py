# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of a head: of its skin here and there, and of hair that goes with it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.mesh import HeadMesh
from generator.heads.textures import open_image
from generator.heads.tiling import texels
from generator.worn.fit import Fit

PIXELS = 512
"""Textures are looked at in this size."""

BEARD = 0.4
"""Skin that differs more from the cheeks, added over the channels, is not skin."""

DYED = 0.35
"""How often hair is not of the colour that goes with brows and beard."""

PAINTED, DARK = 0.72, 1.25
"""A crown darker than this share of the face, and than this, added over the channels, has hair."""

HAIR = {
    "black": (0.060, 0.052, 0.050),
    "dark brown": (0.155, 0.105, 0.078),
    "brown": (0.275, 0.185, 0.125),
    "light brown": (0.42, 0.30, 0.20),
    "dark blond": (0.54, 0.42, 0.27),
    "blond": (0.72, 0.58, 0.38),
    "red": (0.47, 0.22, 0.10),
    "grey": (0.52, 0.51, 0.50),
    "white": (0.82, 0.81, 0.79),
}
"""sRGB of hair in the light."""

_DARK_SKIN = {"black": 0.6, "dark brown": 0.3, "grey": 0.1}
_FAIR_SKIN = {
    "black": 0.16, "dark brown": 0.22, "brown": 0.2, "light brown": 0.12, "dark blond": 0.08, "blond": 0.08,
    "red": 0.05, "grey": 0.06, "white": 0.03,
}  # fmt: skip


@dataclass(frozen=True)
class Complexion:
    """Colours of one head, sRGB 0-1. forehead, cheek, neck, crown: what it has there. painted: is there hair
    on the crown, as far as its colour says?"""

    forehead: np.ndarray
    cheek: np.ndarray
    neck: np.ndarray
    crown: np.ndarray

    @property
    def painted(self) -> bool:
        """Is the crown so much darker than the face that it is no stubble?"""
        crown = float(self.crown.sum())
        return crown < PAINTED * float(self.forehead.sum()) and crown < DARK


def complexion(fit: Fit) -> Complexion:
    """What colours a head has. Raises CannotWear if a landmark is missing, HeadError for a broken texture."""
    forehead, cheeks, chin, ears = fit.at(151)[0], fit.at(50, 280), fit.at(152)[0], fit.at(234, 454)
    behind = ears[:, 2].mean() - 10.0
    crown = np.array([[x, 1000.0, z] for x in (-30.0, 0.0, 30.0) for z in (behind - 20, behind, behind + 20)])
    neck = np.array([[x, chin[1] - drop, 1000.0] for x in (-12.0, 0.0, 12.0) for drop in (18.0, 24.0)])
    front = np.array([0.0, 0.0, 1.0])
    face = np.concatenate([forehead[None], cheeks]) + 1000 * front
    found = surface_colors(fit, face, np.tile(-front, (3, 1)))
    skin = np.nanmean(found, axis=0) if np.isfinite(found).any() else np.array([0.75, 0.58, 0.48])
    found = np.where(np.isfinite(found), found, skin)
    above = surface_colors(fit, crown, np.tile([0.0, -1.0, 0.0], (len(crown), 1)))
    below = surface_colors(fit, neck, np.tile(-front, (len(neck), 1)))
    cheek = found[1:].mean(axis=0)
    throat = _median(below, cheek)
    # A beard that is painted below the chin is no skin.
    throat = throat if np.abs(throat - cheek).sum() < BEARD else cheek
    return Complexion(found[0], cheek, throat, _median(above, found[0]))


def hair_color(look: Complexion, rng: np.random.Generator) -> np.ndarray:
    """Colour of hair, sRGB [3]: the painted one, which brows go with; else mostly the natural one."""
    dyed, odds = rng.random() < DYED, rng.random()
    natural = natural_hair_color(look, rng)
    # Paint is darkest between the strands, and hair in the light is not.
    return 1.12 * natural + 0.01 if look.painted or not dyed else _some_color(look, odds)


def natural_hair_color(look: Complexion, rng: np.random.Generator) -> np.ndarray:
    """Colour of a head's hair, brows and beard, sRGB [3], a little lighter or darker from draw to draw."""
    shade = rng.uniform(0.88, 1.1)
    if look.painted:
        return np.clip(look.crown * shade, 0, 0.85)
    # The same for all that grows on a head, whatever else is drawn.
    own = np.random.default_rng([*(look.forehead * 255).astype(int), *(look.cheek * 255).astype(int)])
    return np.clip(0.95 * _some_color(look, own.random()) * shade, 0, 0.85)


def _some_color(look: Complexion, odds: float) -> np.ndarray:
    fair = float(np.clip((look.forehead @ [0.3, 0.59, 0.11] - 0.42) / 0.2, 0, 1))
    share = {name: fair * _FAIR_SKIN[name] + (1 - fair) * _DARK_SKIN.get(name, 0.0) for name in HAIR}
    edges = np.cumsum(list(share.values()))
    return np.array(HAIR[list(HAIR)[int(np.searchsorted(edges / edges[-1], odds))]])


def surface_colors(fit: Fit, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """sRGB of where rays first meet the head, float64 [N, 3]; NaN where they miss.

    origins, directions: float [N, 3], frame U.
    """
    mesh = fit.mesh
    hits = fit.surface.first_hits(origins @ CAMERA_FROM_GRAPHICS, directions @ CAMERA_FROM_GRAPHICS)
    triangles, weights = hits.triangles, hits.weights
    colors = np.full((len(origins), 3), np.nan)
    for row in np.flatnonzero(triangles >= 0):
        colors[row] = _color(mesh, int(triangles[row]), weights[row])
    return colors


def _color(mesh: HeadMesh, triangle: int, weights: np.ndarray) -> np.ndarray:
    material = mesh.materials[mesh.material_index[triangle]]
    if material.texture is not None and mesh.uv is not None:
        picture = _picture(material.texture)
        place = texels(weights @ mesh.uv[triangle].astype(np.float64), material.wrap, picture.shape[:2])
        return picture[place].astype(np.float64) / 255
    if mesh.vertex_colors is not None:
        return weights @ mesh.vertex_colors[mesh.triangles[triangle]].astype(np.float64)
    return np.array(material.base_color, dtype=np.float64)


@lru_cache(maxsize=4)
def _picture(path: Path) -> np.ndarray:
    with open_image(path) as image:
        image.draft("RGB", (PIXELS, PIXELS))
        return np.asarray(image.convert("RGB").resize((PIXELS, PIXELS)))


def _median(colors: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    there = colors[np.isfinite(colors).all(axis=1)]
    return np.median(there, axis=0) if len(there) else otherwise
