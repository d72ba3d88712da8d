# SPDX-License-Identifier: GPL-3.0-or-later
"""Haircuts: how long hair is where, how it is combed and how it falls."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Cut:
    """A haircut. Lengths in mm of a usual head.

    locks: how many, of so many points each, width mm wide. top, side, back, front: lengths of hair that
    grows there. taper: share of the length that is left at the edge. layer: how thick the hair lies on the
    top, flat: share of it at the sides. sweep: how far hair above the forehead is combed up and to the right.
    comb: how it is combed, a name of :data:`generator.worn.growing.COMBS`; pull: how strongly. stand: how
    much it leaves the skin upwards. fall: its weight. hug: share of what it stands off beyond its layer
    that is pressed back in each step. stray: how unlike neighbours are. curl: radius and length of its
    waves, mm. level: how far above (below, if negative) the chin hair that hangs ends, mm. fringe: how far
    above the brows a fringe ends; NaN without. parting: where the parting is, mm right of the middle. open:
    azimuth, degrees, up to which hair that hangs leaves the face free. backwards, relax: how far back hair
    is combed beside a parting, and how soon it is no longer held. knot: elevation, degrees, of where hair is
    gathered behind; tail: length of what hangs from there, 0 for a bun. gloss: of what is combed; hair that
    lies every way is matt, and a little gloss on it would be a grey veil.
    """

    locks: int = 2000
    points: int = 6
    width: float = 5.5
    top: float = 40.0
    side: float = 22.0
    back: float = 24.0
    front: float = 40.0
    taper: float = 0.45
    layer: float = 9.0
    flat: float = 0.45
    sweep: float = 0.0
    comb: str = "whorl"
    pull: float = 0.8
    stand: float = 0.5
    fall: float = 0.12
    hug: float = 0.25
    stray: float = 0.25
    curl: tuple[float, float] = (0.0, 30.0)
    level: float = float("nan")
    fringe: float = float("nan")
    parting: float = 0.0
    backwards: float = -0.35
    relax: float = 1.0
    open: float = 62.0
    knot: float = 30.0
    tail: float = 0.0
    gloss: float = 0.0

    @property
    def hangs(self) -> bool:
        """Does hair leave the head and hang?"""
        return bool(np.isfinite(self.level))

    @property
    def hides_little(self) -> bool:
        """Does it show the hairline?"""
        return not (self.hangs or np.isfinite(self.fringe))


CUTS = {
    "short": Cut(sweep=0.9, locks=2180, width=4.6, taper=0.3, flat=0.3),
    "parted": Cut(top=75, side=30, back=30, front=80, comb="part", pull=1.1, stand=0.45, layer=13, stray=0.22,
                  fall=0.1, taper=0.35, flat=0.35, parting=32, width=5, locks=2180, gloss=0.5),
    "slick": Cut(top=85, side=45, back=35, front=90, comb="back", pull=1.3, stand=0.3, layer=8, stray=0.14,
                 fall=0.08, hug=0.5, width=5, locks=2180, gloss=0.5),
    "fringe": Cut(top=95, side=60, back=60, front=110, comb="whorl", pull=0.8, stand=0.25, layer=12,
                  stray=0.22, fall=0.3, fringe=6, taper=0.7, width=5.5,
                  points=7, locks=1900, flat=0.6, relax=2.0),
    "bob": Cut(top=240, side=190, back=170, front=230, comb="part", pull=0.8, stand=0.3, layer=14, stray=0.12,
               fall=1.1, level=8, taper=0.9, width=6.2, points=8, locks=1550, hug=0.15, parting=14,
               backwards=-0.05, relax=2.5, gloss=0.5),
    "long": Cut(top=400, side=330, back=330, front=390, comb="part", pull=0.8, stand=0.3, layer=15,
                stray=0.12, fall=1.1, level=-105, taper=0.9, width=7.2, points=9, locks=1300, hug=0.12,
                parting=-12, backwards=-0.05, relax=2.5, gloss=0.5),
    "curly": Cut(top=95, side=65, back=70, front=85, comb="whorl", pull=0.35, stand=0.9, layer=26, stray=0.7,
                 fall=0.22, curl=(6.5, 26), taper=0.8, width=6, points=13, locks=900, hug=0.2),
    "afro": Cut(top=62, side=50, back=52, front=50, comb="whorl", pull=0.12, stand=1.6, layer=34, stray=0.55,
                fall=0.02, curl=(4.0, 15), taper=0.75, width=6, points=7, locks=1760, hug=0.0),
    "bun": Cut(top=260, side=260, back=260, front=260, comb="gather", pull=1.6, stand=0.1, layer=6,
               stray=0.08, fall=0.03, hug=0.6, width=6.5, points=9, locks=1100, taper=1, knot=38,
               gloss=0.5),
    "ponytail": Cut(top=260, side=260, back=260, front=260, comb="gather", pull=1.6, stand=0.1, layer=6,
                    stray=0.08, fall=0.03, hug=0.6, width=6.5, points=9, locks=1000, taper=1,
                    knot=22, tail=230, gloss=0.5),
    "buzz": Cut(top=10, side=7, back=7, front=9, locks=9000, points=2, width=1.5, layer=3.5, stand=0.35,
                pull=0.7, stray=0.6, taper=0.8, fall=0.05, hug=0.5),
}  # fmt: skip


def draw_cut(style: str, rng: np.random.Generator) -> Cut:
    """A cut of a style with lengths of its own."""
    cut = CUTS[style]
    longer, thicker, side, wave, drop, bangs = rng.uniform(0, 1, 6)
    grown = 0.8 + 0.45 * longer
    if cut.comb == "part":
        cut = replace(cut, parting=cut.parting * (1 if side < 0.5 else -1) * (0.6 + 0.7 * wave))
    if style in ("bob", "long", "fringe") and wave > 0.5:
        cut = replace(cut, curl=(7 * (wave - 0.4), 60 + 40 * drop))
    if cut.hangs and bangs < 0.25:
        cut = replace(cut, fringe=5.0)
    return replace(
        cut,
        top=cut.top * grown, side=cut.side * grown, back=cut.back * grown, front=cut.front * grown,
        layer=cut.layer * (0.75 + 0.5 * thicker),
        level=cut.level + (drop - 0.5) * (40 if style == "bob" else 110),
        fringe=cut.fringe + 12 * (drop - 0.4),
        sweep=cut.sweep * (2 * wave - 1),
    )  # fmt: skip
