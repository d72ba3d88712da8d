# SPDX-License-Identifier: GPL-3.0-or-later
"""The head that something is fitted to: its mesh, its landmarks, and rays onto its surface."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np

from generator.errors import HeadError
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.mesh import HeadMesh
from generator.landmarks.surface import Surface

T = TypeVar("T")


class CannotWear(HeadError):
    """Something does not fit a head: it is left out, and the row says why. The message is the reason."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A head in frame U, mm, pivot at the origin: x image right, y up, z towards the viewer.

    mesh: the head. points: float64 [P, 3], its landmarks (Face Mesh) on the mesh; NaN where there is none.
    others: what else it wears of the kinds that the maker minds, kind -> style. things: folder of a user's
    own things; scratch: an existing folder for textures that are made, which stays as long as what is worn.
    known: what was found of this mesh and these landmarks, whatever else is worn; see :meth:`once`.
    """

    mesh: HeadMesh
    points: np.ndarray
    others: Mapping[str, str] = field(default_factory=dict)
    things: str = ""
    scratch: str = ""
    known: dict[Hashable, Any] = field(default_factory=dict, init=False, repr=False)

    def beside(self, others: Mapping[str, str]) -> Fit:
        """The very same head, of which all is known that was found already, wearing other things."""
        made = replace(self, others=others)
        object.__setattr__(made, "known", self.known)
        return made

    def once(self, key: Hashable, find: Callable[[], T]) -> T:
        """What depends on mesh, landmarks and key alone: found once, for all that the head wears."""
        if key not in self.known:
            self.known[key] = find()
        found: T = self.known[key]
        return found

    def at(self, *places: int) -> np.ndarray:
        """Landmarks by their number, float64 [len(places), 3]. Raises CannotWear if one has no place."""
        found = self.points[list(places)]
        missing = [place for place, point in zip(places, found, strict=True) if not np.isfinite(point).all()]
        if missing:
            raise CannotWear(f"landmark {missing[0]} has no place on the mesh")
        return found

    @property
    def surface(self) -> Surface:
        """The mesh for rays (in frame C)."""
        return self.once("surface", lambda: Surface(self.mesh))

    def cast(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Where rays first meet the head, float64 [N, 3]; NaN where they miss. float [N, 3] twice."""
        hits = self.surface.first_hits(origins @ CAMERA_FROM_GRAPHICS, directions @ CAMERA_FROM_GRAPHICS)
        return hits.points @ CAMERA_FROM_GRAPHICS

    def outermost(self, centre: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """How far from a centre the head reaches along unit directions [N, 3]: float64 [N], mm, seen from
        outside; NaN where there is nothing."""
        far = 1000.0
        hits = self.cast(centre + far * directions, -directions)
        return ((hits - centre) * directions).sum(axis=1)


Make = Callable[[Fit, str, np.random.Generator], HeadMesh]
"""(head, style, rng) -> a mesh in the head's frame U, mm. rng depends on head, kind, style and variant."""


@dataclass(frozen=True)
class Kind:
    """Something that is worn.

    make: raises :class:`CannotWear` where it does not fit. minds: other kinds whose style changes its shape,
    such as hair, which is flat under a hat.
    """

    make: Make
    minds: tuple[str, ...] = ()
