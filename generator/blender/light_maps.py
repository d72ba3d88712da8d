# SPDX-License-Identifier: GPL-3.0-or-later
"""The fast preset's light as small maps over all directions, where materials look it up: numbers alone.

What a surface gets is a function of its normal, and what it mirrors one of the mirrored view, so each is
computed once for a few thousand directions, whatever lamps and panoramas there are, and not in every pixel. A
map is azimuth by elevation, with a border of one texel that holds what lies across its edges.

What is mirrored is a lobe about the mirrored view, exp(s (cosine - 1)) with s = 1 / (2 a^2) for a GGX
roughness a, the spherical Gaussian of Wang et al., "All-frequency rendering of dynamic, spatially-varying
reflectance" (SIGGRAPH Asia 2009); it sends back all the light it gets, times Schlick's Fresnel term. No lamp
is a point: its own width is added. The surroundings are degree 0 and 1 of the terms of their irradiance, of
which less is blurred away (Ramamoorthi and Hanrahan, "A signal-processing framework for reflection", ACM TOG
23(4), 2004).

Frame B: x image right, y into the scene, z up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from generator.blender.lamps import key_direction, key_strengths, lamp_light
from generator.heads.shine import Kind, Kinds
from generator.plan.environment_light import EnvironmentLight
from generator.plan.settings import Look

WIDTH = 128
"""Of a sheet of maps, in texels; a power of two, as its height, so that where a map lies changes no digit."""

BORDER = 1

FACING = 0.028
"""What a surface mirrors that is seen straight on: an index of refraction of 1.4, of skin and corneas."""

CLEAR = 0.7
"""Of a gloss above that the highlights are narrower than four texels of a coarse map."""

LAMP_WIDTH = 0.012
"""1 / s of a lamp as wide as the quality preset's: a disc of 25 degrees."""

LESS_BLURRED = 1.15
"""What a lobe as wide as skin's (s about 4) keeps of degree 1, over what irradiance does."""


@dataclass(frozen=True)
class Tile:
    """Where a map lies in the sheet, its border included. Texels, from the lower left."""

    x: int
    y: int
    width: int
    height: int

    @property
    def scale(self) -> tuple[float, float]:
        """Texels in a radian of azimuth, and of elevation."""
        return (self.width - 2 * BORDER) / (2 * np.pi), (self.height - 2 * BORDER) / np.pi

    @property
    def middle(self) -> tuple[float, float]:
        """Where azimuth 0 and elevation 0 are."""
        return self.x + self.width / 2, self.y + self.height / 2


AMBIENT = Tile(0, 0, WIDTH // 2, WIDTH // 4)
ALL = Tile(WIDTH // 2, 0, WIDTH // 2, WIDTH // 4)


class Layout:
    """Which map lies where in the sheet of an object: light from everywhere, that and the light of lamps, and
    what each kind of gloss mirrors that its materials have."""

    def __init__(self, kinds: Kinds) -> None:
        self.height = AMBIENT.height
        self.shine: dict[Kind, Tile] = {}
        free: list[Tile] = []
        for kind in kinds:
            if isinstance(kind, str) or kind > CLEAR:
                self.shine[kind] = Tile(0, self.height, WIDTH, WIDTH // 2)
                self.height += WIDTH // 2
                continue
            if not free:
                free = [Tile(x, self.height, WIDTH // 2, WIDTH // 4) for x in (WIDTH // 2, 0)]
                self.height += WIDTH // 4
            self.shine[kind] = free.pop()


@lru_cache(maxsize=256)
def layout_of(kinds: Kinds) -> Layout:
    """The layout of an object whose materials have these kinds of gloss."""
    return Layout(kinds)


@lru_cache(maxsize=8)
def directions(width: int, height: int) -> np.ndarray:
    """Unit vectors of a map's texels, border included, float32 [height, width, 3]; the middle is at +y, its
    right towards +x, its top at +z."""
    azimuth = ((np.arange(width) - BORDER + 0.5) / (width - 2 * BORDER) - 0.5) * 2 * np.pi
    elevation = (((np.arange(height) - BORDER + 0.5) / (height - 2 * BORDER)) - 0.5)[:, None] * np.pi
    level = np.cos(elevation)
    vectors = (
        level * np.sin(azimuth),
        level * np.cos(azimuth),
        np.broadcast_to(np.sin(elevation), (height, width)),
    )
    return np.stack(vectors, axis=-1).astype(np.float32)


class Light:
    """The light of a look, and of an environment where there is one. Directions: float32 [..., 3], unit."""

    def __init__(self, look: Look, environment: EnvironmentLight | None) -> None:
        self._environment = environment
        self._key, self._white = key_strengths(look, environment)
        self._towards = np.array(key_direction(look), np.float32)
        lamps = [lamp_light(lamp) for lamp in look.lamps]
        if environment is not None:
            lamps.append((environment.direction, environment.sun))
        self._lamps = np.array([direction for direction, _ in lamps], np.float32).reshape(-1, 3)
        self._colors = np.array([color for _, color in lamps], np.float32).reshape(-1, 3)
        self._mirrored: dict[tuple[int, int, float], np.ndarray] = {}

    @cached_property
    def sent(self) -> tuple[np.ndarray, np.ndarray]:
        """Maps of what a white surface sends back: of light from everywhere, and of that and of lamps."""
        normals = directions(AMBIENT.width, AMBIENT.height)
        ambient = self.ambient(normals)
        return ambient, ambient + self.direct(normals)

    def shine(self, width: int, height: int, gloss: float) -> np.ndarray:
        """A map of what is mirrored; made once for all objects that have that gloss."""
        key = width, height, gloss
        if key not in self._mirrored:
            # Blender reflects where a look goes, which is the reverse of where the light comes from.
            self._mirrored[key] = self.mirrored(-directions(width, height), gloss)
        return self._mirrored[key]

    def ambient(self, normals: np.ndarray) -> np.ndarray:
        """What a white surface sends back of light from everywhere, linear RGB [..., 3]."""
        light = np.full(normals.shape, self._white, np.float32)
        if self._environment is not None:
            x, y, z = np.moveaxis(normals, -1, 0)
            terms = np.stack([np.ones_like(x), x, y, z, x * y, y * z, z * x, x * x, y * y], axis=-1)
            form = terms @ np.array(self._environment.terms, np.float32)
            light += np.maximum(form, np.array(self._environment.least, np.float32))
        return light

    def direct(self, normals: np.ndarray) -> np.ndarray:
        """And of lamps: cosines, and half-Lambert of the key light (Mitchell et al., "Illustrative rendering
        in Team Fortress 2", 2007), which keeps the shadow side readable."""
        cosines = np.maximum(normals @ self._lamps.T, 0)
        key = self._key * (normals @ self._towards * 0.5 + 0.5) ** 2
        light: np.ndarray = cosines @ self._colors + key[..., None]
        return light

    def mirrored(self, rays: np.ndarray, gloss: float) -> np.ndarray:
        """What comes from some directions to a surface of that gloss, before Fresnel's term."""
        if gloss <= 0:
            return np.zeros(rays.shape, np.float32)
        sharp = np.float32(sharpness(gloss))
        spots = np.vstack([self._lamps, self._towards])
        colors = np.vstack([self._colors, np.full(3, self._key, np.float32)])
        lit = colors.any(axis=1)
        lobes = np.exp(sharp * (rays @ spots[lit].T - 1))
        # A clear mirror shows a few bright things among many dark ones, and no haze. A lobe holds 2 pi / s; a
        # white surface before a lamp of strength 1 gets pi.
        light: np.ndarray = self._around(rays) * np.float32(1 - gloss * gloss) + lobes @ colors[lit] * (
            sharp / 2
        )
        return light

    def _around(self, rays: np.ndarray) -> np.ndarray:
        """Of the terms of the surroundings a lobe sees the mean, and more of degree 1 than irradiance has;
        degree 2 is left out, as most of it is of what skin mirrors."""
        light = np.full(rays.shape, self._white, np.float32)
        if self._environment is not None:
            terms = np.array(self._environment.terms, np.float32)
            light += terms[0] + (terms[7] + terms[8]) / 3 + LESS_BLURRED * (rays @ terms[1:4])
        return light


def sharpness(gloss: float) -> float:
    """s of the roughness that artists know, whose square is a (Burley, SIGGRAPH 2012)."""
    return 1 / (2 * (1 - gloss) ** 4 + LAMP_WIDTH)


def rim(gloss: float) -> float:
    """What of the light is mirrored at a grazing view, where Schlick has 1: what is rough hides itself."""
    return max(gloss**3, FACING)


def draw(
    sheet: np.ndarray, layout: Layout, light: Light, glosses: Mapping[Kind, float], occlusion: float
) -> None:
    """Draw into a sheet of zeros, float32 [layout.height, WIDTH, 4].

    glosses: of each kind. The fourth number is the share of light that what is closed in loses, in the map of
    ambient light, and :func:`rim` in those of what is mirrored.
    """

    def place(tile: Tile, colors: np.ndarray, number: float) -> None:
        there = sheet[tile.y : tile.y + tile.height, tile.x : tile.x + tile.width]
        there[..., :3], there[..., 3] = colors, number

    ambient, every = light.sent
    place(AMBIENT, ambient, occlusion)
    place(ALL, every, 1.0)
    for kind, tile in layout.shine.items():
        gloss = glosses[kind]
        place(tile, light.shine(tile.width, tile.height, gloss), rim(gloss))
