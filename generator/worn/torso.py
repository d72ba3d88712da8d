# SPDX-License-Identifier: GPL-3.0-or-later
"""A neck that goes on where a head ends, and shoulders below it, as distances from the neck's axis."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import PchipInterpolator
from scipy.ndimage import gaussian_filter, gaussian_filter1d, maximum_filter

from generator.worn.complexion import Complexion, surface_colors
from generator.worn.fit import CannotWear, Fit
from generator.worn.skull import UNIT_MM
from generator.worn.strips import Piece

COLUMNS = 96
"""Around the neck, from the front over image right."""

# Half width, reach to the front and to the back, mm; heights at the side, in front and behind, mm above the
# chin; from the neck down over the shoulders.
_RINGS = np.array(
    [
        [60, 57, 62, -58, -76, -42],
        [76, 64, 70, -66, -86, -50],
        [112, 77, 80, -82, -104, -66],
        [152, 92, 90, -96, -130, -92],
        [186, 105, 98, -114, -165, -128],
        [204, 114, 104, -142, -205, -170],
        [212, 120, 106, -190, -250, -220],
        [214, 124, 106, -250, -300, -275],
        [210, 120, 104, -340, -370, -355],
        [198, 112, 100, -490, -500, -495],
        [186, 106, 96, -660, -660, -660],
    ]
)
_ROUND = 2.35
"""Exponent of the rings: 2 is an ellipse, more is squarer."""

NECK_MM = (56.0, 60.0, 58.0)
"""Of a neck that is not there: half width, front, back."""

HANGS = 3.5
"""Below this ring, above which are the shoulders, cloth hangs."""

GAP_MM = 4.0
"""Between the body that a head has and what it wears."""


@dataclass(frozen=True, eq=False)
class Torso:
    """Neck and shoulders of a head. Angles are 0 in front and grow towards image right, [COLUMNS].

    fit: without hair. axis: x and z of the neck's axis, mm. chin: its height. scale: of lengths.
    end, neck: height at which the head's own neck ends, and its distance from the axis there, [COLUMNS].
    raised: how much higher than usual its own shoulders begin, mm, [COLUMNS].
    """

    fit: Fit
    axis: np.ndarray
    chin: float
    scale: float
    end: np.ndarray
    neck: np.ndarray
    raised: np.ndarray

    def points(self, reach: np.ndarray, height: np.ndarray) -> np.ndarray:
        """Points [..., COLUMNS, 3] at distances from the axis and heights, mm."""
        x = self.axis[0] + reach * np.sin(ANGLES)
        return np.stack([x, height, self.axis[1] + reach * np.cos(ANGLES)], axis=-1)

    def own(self, height: np.ndarray) -> np.ndarray:
        """How far the head's own body reaches at heights [R, COLUMNS], mm; 0 where it has none."""
        start = np.stack(
            [
                np.broadcast_to(self.axis[0], height.shape),
                height,
                np.broadcast_to(self.axis[1], height.shape),
            ],
            axis=-1,
        ).reshape(-1, 3)
        out = np.broadcast_to(_OUT, (*height.shape, 3)).reshape(-1, 3)
        hits = self.fit.cast(start + 600 * out, -out)
        reach = ((hits - start) * out).sum(axis=1).reshape(height.shape)
        return np.round(np.where(np.isfinite(reach) & (reach > 0), reach, 0.0), 3)

    def body(self, height: np.ndarray) -> np.ndarray:
        """How far neck or body reach at heights [R, COLUMNS], mm, and just above and below them."""
        own = maximum_filter(self.own(height), size=3, mode=("nearest", "wrap"))
        return np.maximum(self.neck_reach(height), own)

    def neck_reach(self, height: np.ndarray) -> np.ndarray:
        """How far the neck reaches at heights [R, COLUMNS]: as it ends, then to its usual foot."""
        foot = self.scale * _ring(*_RINGS[0, :3])
        share = np.clip((self.end - height) / (45 * self.scale), 0, 1)
        return self.neck + (foot - self.neck) * share * share * (3 - 2 * share)

    def surface(self, rows: int, offset: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
        """Reach and height, [rows, COLUMNS] mm, of shoulders from the neck down, lifted by an offset."""
        side = np.sin(ANGLES) ** 2
        ahead = np.where(np.cos(ANGLES) > 0, 1.0, 0.0)
        heights = [side * ring[3] + (1 - side) * (ahead * ring[4] + (1 - ahead) * ring[5]) for ring in _RINGS]
        reaches = [_ring(*ring[:3]) for ring in _RINGS]
        place = np.linspace(0, len(_RINGS) - 1, rows)
        knots = np.arange(len(_RINGS))
        height = self.chin + self.scale * PchipInterpolator(knots, np.array(heights))(place)
        height = height + np.exp(-((place / 2.6) ** 2))[:, None] * self.raised
        usual = self.scale * PchipInterpolator(knots, np.array(reaches))(place)
        # At the neck it is the neck that says how wide.
        near = np.exp(-place / 1.1)[:, None]
        reach = usual + near * (self.neck_reach(height) - self.scale * reaches[0])
        own = maximum_filter(self.own(height), size=3, mode=("nearest", "wrap"))
        gap = GAP_MM * self.scale * np.minimum(1, 0.4 + place)[:, None]
        reach = np.maximum(reach, own + gap * (own > 0))
        # Cloth hangs from a bust that ends at its chest; it does not follow it in.
        for row in range(1, rows):
            if place[row] > HANGS:
                reach[row] = np.maximum(reach[row], 0.985 * reach[row - 1])
        smoothed = gaussian_filter(reach, (1.2, 1.2), mode=("nearest", "wrap"))
        reach = np.maximum(smoothed, own + 0.4 * gap)
        return reach + offset * self.scale, height

    def skin(self, look: Complexion, down: float) -> Piece:
        """The neck from inside the head's own to so many mm below the height of the collar."""
        start = self.end + 16 * self.scale
        foot = self.chin + self.scale * (_collar_heights() - down) + self.raised
        rows = np.linspace(0, 1, 15)[:, None]
        height = start + (np.minimum(foot, self.end - 12 * self.scale) - start) * rows
        # From within the head's own neck it comes out before that ends, and covers its edge.
        inside = np.clip((height - self.end - 5 * self.scale) / (9 * self.scale), 0, 1)
        reach = self.neck_reach(height) + self.scale * (0.8 - 3.0 * inside)
        own = self.own(height)
        # Where the head has a body of its own, nothing of this is to be seen.
        shoulders = (own > 0.9 * reach) & (height < self.end - 4 * self.scale) & (self.raised > 1)
        collar = self.chin + self.scale * (_collar_heights() - 4) + self.raised
        shoulders |= (own > 0) & (self.own(collar[None]) > 0.85 * self.neck_reach(collar[None]))
        reach = np.where(shoulders, np.minimum(reach, own - 1.5 * self.scale), reach)
        points = self.points(reach, height)
        tone = self._tones(look)
        colors = np.broadcast_to(tone, points.shape)
        # Darker below, as in the shadow of the chin and in a collar.
        return grid(points, colors * (1 - 0.12 * rows[..., None]))

    def _tones(self, look: Complexion) -> np.ndarray:
        """Colour of the skin around the end of the head's own neck, [COLUMNS, 3]."""
        height = self.end + 6 * self.scale
        start = self.points(np.full(COLUMNS, 400.0), height)
        found = surface_colors(self.fit, start, -_OUT)
        # Where hair or a cap is painted, the neck's colour.
        skin = look.neck
        odd = ~np.isfinite(found).all(axis=1) | (np.abs(found - skin).sum(axis=1) > 0.35)
        found[odd] = skin
        return gaussian_filter1d(found, 4, axis=0, mode="wrap")


ANGLES = np.arange(COLUMNS) / COLUMNS * 2 * np.pi
_OUT = np.stack([np.sin(ANGLES), 0 * ANGLES, np.cos(ANGLES)], axis=1)


def find_torso(fit: Fit) -> Torso:
    """Where the neck of a head is. Raises CannotWear if a landmark is missing. fit: without hair."""
    width = fit.at(234, 454)
    scale = float(np.linalg.norm(width[1] - width[0])) / UNIT_MM
    if not 0.3 < scale < 3:
        raise CannotWear("its face is not of a head's size")
    chin, jaw = fit.at(152)[0], width[:, 2].mean()
    middle = (chin[0] + fit.at(10)[0, 0]) / 2
    starts = np.array([[middle, chin[1] - 20 * scale, 500.0], [middle, chin[1] + 22 * scale, -500.0]])
    front, back = fit.cast(starts, np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]))[:, 2]
    front = front if front > jaw - 40 * scale else jaw + 20 * scale
    back = back if back < jaw - 40 * scale else jaw - 85 * scale
    depth = float(np.clip((front + back) / 2, jaw - 60 * scale, jaw + 5 * scale))
    axis = np.round([middle, depth], 3)
    torso = Torso(fit, axis, float(chin[1]), scale, *[np.zeros(COLUMNS)] * 3)
    return _with_neck(torso)


def _with_neck(torso: Torso) -> Torso:
    """Where the head's own neck ends, by rays at many heights from all sides."""
    scale, usual = torso.scale, torso.scale * _ring(*NECK_MM)
    rise = np.arange(60.0, -75.0, -4.0) * scale
    height = torso.chin + np.broadcast_to(rise[:, None], (len(rise), COLUMNS))
    own = torso.own(height)
    lowest = torso.chin + scale * (_collar_heights() + 10)
    # From the head down: a neck gets narrower, and ends where there is nothing or where shoulders begin.
    narrowest, last = np.full(COLUMNS, np.inf), np.full(COLUMNS, -1)
    ended, flares = np.zeros(COLUMNS, dtype=bool), np.zeros(COLUMNS, dtype=bool)
    for row, reach in enumerate(own):
        # A sheet that closes a neck from below is no neck.
        closes = (reach < 0.88 * own[max(row - 1, 0)]) & (own[min(row + 3, len(own) - 1)] < 0.5 * usual)
        there = (reach > 0.5 * usual) & ~closes
        narrowest = np.where(there & ~ended, np.minimum(narrowest, reach), narrowest)
        wide = np.maximum(1.5 * narrowest, 1.25 * usual)
        flares |= ~ended & (narrowest < 1.35 * usual) & (reach > wide)
        ended |= flares | (~there & (last >= 0))
        last[~ended & there & (reach < wide) & (reach < 1.5 * usual) & (height[row] > lowest)] = row
    there, place = last >= 0, np.maximum(last, 0)
    # So do necks that end as they begin to widen.
    flares |= there & (own[place, np.arange(COLUMNS)] > 1.12 * narrowest)
    end = np.where(there, height[place, np.arange(COLUMNS)], torso.chin + 20 * scale)
    reach = np.where(there, own[place, np.arange(COLUMNS)], usual)
    raised = np.where(flares, np.maximum(end - lowest + 6 * scale, 0), 0)
    raised = gaussian_filter1d(maximum_filter(raised, size=5, mode="wrap"), 4, mode="wrap")
    end, reach = (gaussian_filter1d(values, 2, mode="wrap") for values in (end, reach))
    return replace(torso, end=end, neck=reach, raised=raised)


def _collar_heights() -> np.ndarray:
    """Heights of the foot of a neck above the chin of a usual head, [COLUMNS]."""
    side = np.sin(ANGLES) ** 2
    return side * _RINGS[0, 3] + (1 - side) * np.where(np.cos(ANGLES) > 0, _RINGS[0, 4], _RINGS[0, 5])


def _ring(width: float, front: float, back: float) -> np.ndarray:
    """Distance from the axis of a ring with these half axes, [COLUMNS]."""
    depth = np.where(np.cos(ANGLES) > 0, front, back)
    sides = (np.abs(np.sin(ANGLES)) / width) ** _ROUND + (np.abs(np.cos(ANGLES)) / depth) ** _ROUND
    return sides ** (-1 / _ROUND)


def grid(points: np.ndarray, colors: np.ndarray, *, closed: bool = True) -> Piece:
    """A sheet through points [R, C, 3] from above down, seen from outside; closed: its columns are a ring."""
    rows, columns = points.shape[:2]
    number = np.arange(rows * columns).reshape(rows, columns)
    if closed:
        number = np.concatenate([number, number[:, :1]], axis=1)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Piece(points.reshape(-1, 3), triangles, np.broadcast_to(colors, points.shape).reshape(-1, 3))
