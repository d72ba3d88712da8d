# SPDX-License-Identifier: GPL-3.0-or-later
"""What the materials of a stage have nodes for."""

from __future__ import annotations

from dataclasses import astuple, dataclass, replace

from generator.plan.render_settings import NOTHING, PLAIN, is_denoised
from generator.plan.settings import Look


@dataclass(frozen=True)
class Needs:
    """What a look needs of materials and world besides a key light and ambient light; no other node is made.

    environment: a panorama may light it. occlusion: light is kept out of what is closed in. lamps: how many
    are lit. gloss: the skin has some. relief: it has pores and folds.
    """

    environment: bool = False
    occlusion: bool = False
    lamps: int = 0
    gloss: bool = False
    relief: bool = False

    @classmethod
    def of(cls, look: Look, environment: bool = False) -> Needs:
        """Those of a look, which a panorama lights or not."""
        occlusion = look.preset == "fast" and look.occlusion > 0
        return cls(environment, occlusion, len(look.lamps), look.gloss > 0, look.skin_detail > 0)

    @property
    def maps(self) -> bool:
        """Does light come from more than a key light, so that the fast preset looks it up?"""
        return self.environment or self.occlusion or self.lamps > 0 or self.gloss

    def cover(self, others: Needs) -> bool:
        """Is there a node for all that others need, and none that changes their pixels? Relief does: a normal
        that is leaned by nothing and made a unit again has other digits, as has light that is looked up."""
        more = all(mine >= other for mine, other in zip(astuple(self), astuple(others), strict=True))
        return more and self.relief == others.relief and self.maps == others.maps

    def __or__(self, others: Needs) -> Needs:
        """What one or the other needs; the relief of the first, which alone counts where one has no maps."""
        if self.maps != others.maps:
            return self
        return replace(Needs(*map(max, astuple(self), astuple(others))), relief=self.relief)


def is_layered(look: Look) -> bool:
    """Is the head of a look rendered alone, over nothing, to be laid over what is behind it?

    Where light is looked up that is less work than a plain backdrop, too: that is a colour of the world, and
    Cycles compiles every material again for another. And a denoiser would not leave it one colour.
    """
    looked_up = look.preset == "fast" and Needs.of(look, look.environment != NOTHING).maps
    return look.backdrop != PLAIN or looked_up or is_denoised(look)
