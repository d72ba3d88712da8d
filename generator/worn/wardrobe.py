# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head wears in each view: made once, kept for as long as the head is the same."""

from __future__ import annotations

import gc
import shutil
from collections.abc import Sequence, Set
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, rotation_from_angles
from generator.heads.mesh import HeadMesh
from generator.heads.package import save_package
from generator.heads.surroundings import with_triangles
from generator.landmarks.surface import TOGETHER, Surface
from generator.plan.draws import draw_seed, person_of
from generator.plan.views import View, Views
from generator.plan.wear import STYLES, Worn
from generator.registries import WORN
from generator.worn.fit import CannotWear, Fit, Kind

SEE_THROUGH = 0.5
"""Of this opacity and more a material hides what is behind it, and has a depth; Blender's own threshold."""

NEARER_MM = 1.0
"""How far before a landmark something worn has to be to hide it: a brow that lies on the skin does not."""

DIGITS = 4
"""Of a millimetre, in what is made: rounding of other processors changes none."""

KEPT = 64
"""Things of a head that are kept for views to come: a person has about 40, and where each image has its own
there is no end of them."""

LEFT, RIGHT, NOSE = 454, 234, 1
"""Landmarks: the face's sides, whose distance is its width, and the tip of the nose."""


@dataclass(frozen=True, eq=False)
class Thing:
    """Something that was made. path: its package. mesh: frame U, mm."""

    path: Path
    mesh: HeadMesh

    @cached_property
    def surface(self) -> Surface | None:
        """What of it hides landmarks; None where nothing does."""
        solid = [material.opacity >= SEE_THROUGH for material in self.mesh.materials]
        kept = np.array(solid)[self.mesh.material_index]
        return Surface(with_triangles(self.mesh, kept)) if kept.any() else None


@dataclass(frozen=True, eq=False)
class Outfits:
    """What is worn in some views.

    things: of each view, with where each is moved, frame U, mm. left_out: of each view, what could not be
    made and why; "" where nothing was left out. By default nothing is worn.
    """

    things: Sequence[Sequence[tuple[Thing, np.ndarray]]] = ()
    left_out: Sequence[str] = field(default_factory=list)

    @property
    def worn(self) -> tuple[tuple[Worn, ...], ...]:
        """For a render worker."""
        return tuple(
            tuple(Worn(str(thing.path), tuple(offset.tolist())) for thing, offset in one)
            for one in self.things
        )

    def hidden(self, points: np.ndarray, views: Views) -> np.ndarray:
        """Which points of the head it keeps from the cameras, bool [N, P].

        points: float [P, 3], frame C at pose zero, mm; of NaN nothing is said.
        """
        hidden = np.zeros((len(views), len(points)), dtype=bool)
        known = np.flatnonzero(np.isfinite(points).all(axis=1))
        if not self.things:
            return hidden
        rotations = rotation_from_angles(views.angles_deg)
        worn: dict[Thing, list[tuple[int, np.ndarray]]] = {}
        for row, things in enumerate(self.things):
            for thing, offset in things:
                worn.setdefault(thing, []).append((row, offset @ CAMERA_FROM_GRAPHICS))
        for thing, where in worn.items():
            for start in range(0, len(where), TOGETHER):
                rows, offsets = zip(*where[start : start + TOGETHER], strict=True)
                if thing.surface is not None:
                    hidden[np.ix_(rows, known)] |= thing.surface.hides(
                        points[known],
                        rotations[list(rows)],
                        [views[row].camera for row in rows],
                        offsets=np.stack(offsets),
                        nearer_mm=NEARER_MM,
                    )
        return hidden


class Wardrobe:
    """Makes what one head wears after another. folder: for the packages; emptied for every head."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._folder.mkdir(parents=True, exist_ok=True)
        self._fit: Fit | None = None
        self._name = ""
        self._made: dict[tuple[str, ...], Thing | CannotWear] = {}
        self._count = 0

    def dress(self, name: str, mesh: HeadMesh, points: np.ndarray, views: Views, things: str = "") -> Outfits:
        """What a head wears in some views.

        name: subject/expression; colours and sizes are the subject's. mesh: frame U, mm, pivot at the origin;
        the very one, as long as it is the same. points: float [P, 3], landmarks on it, frame C, mm.
        things: folder of a user's own.
        """
        if not any(look.wears for look in views.looks):
            return Outfits()
        known = self._fit
        if known is None or self._name != name or known.mesh is not mesh or known.things != things:
            if known is not None:
                known.known.clear()  # it knows what knows it, and nobody would free it for long
            shutil.rmtree(self._folder)
            self._folder.mkdir()
            on_mesh = points @ CAMERA_FROM_GRAPHICS
            self._name, self._made = name, {}
            self._fit = Fit(mesh, on_mesh, things=things, scratch=str(self._folder))
        dressed = [self._outfit(view) for view in views]
        if len(self._made) > KEPT:
            self._keep({thing for things, _ in dressed for thing, _ in things})
        return Outfits([things for things, _ in dressed], [reason for _, reason in dressed])

    def _outfit(self, view: View) -> tuple[list[tuple[Thing, np.ndarray]], str]:
        things, reasons = [], []
        for kind in view.look.wears:
            try:
                things.append((self._thing(kind, view), self._offset(kind, view)))
            except CannotWear as error:
                reasons.append(f"{kind}: {error}")
        return things, "; ".join(reasons)

    def _thing(self, kind: str, view: View) -> Thing:
        """What is made for a view. Raises CannotWear where it was not."""
        assert self._fit is not None, "a head that is dressed is known"
        maker: Kind = WORN.get(kind)
        style, variant = getattr(view.look, kind), f"{view.look.wear_variant:.6g}"
        others = {other: getattr(view.look, other) for other in maker.minds}
        key = (kind, style, variant, *others.values())
        if key not in self._made:
            rng = np.random.default_rng(draw_seed(0, "worn", person_of(self._name), kind, style, variant))
            try:
                if style not in STYLES.get(kind, (style,)):
                    raise CannotWear(f"there is no {style!r}")
                mesh = maker.make(self._fit.beside(others), style, rng)
                if not np.isfinite(mesh.vertices).all():
                    raise CannotWear("what was made has no finite shape")
                self._made[key] = self._packed(kind, mesh)
            except CannotWear as error:
                self._made[key] = error
        made = self._made[key]
        if isinstance(made, CannotWear):
            raise made
        return made

    def _keep(self, worn: Set[Thing]) -> None:
        """These, and nothing else that was made."""
        for key, made in [*self._made.items()]:
            if isinstance(made, Thing) and made not in worn:
                made.path.unlink()
                del self._made[key]
        assert self._fit is not None, "a head that is dressed is known"
        self._fit.known.clear()
        gc.collect()  # parts of it know each other

    def _packed(self, kind: str, mesh: HeadMesh) -> Thing:
        mesh = replace(mesh, vertices=np.round(mesh.vertices, DIGITS))
        self._count += 1  # a name of its own, by which a render worker knows it
        path = self._folder / f"{kind}-{self._count}.npz"
        save_package(mesh, path)
        return Thing(path, mesh)

    def _offset(self, kind: str, view: View) -> np.ndarray:
        if kind != "occluder":
            return np.zeros(3)
        assert self._fit is not None, "a head that is dressed is known"
        left, right = self._fit.at(LEFT, RIGHT)
        width = float(np.linalg.norm(left - right))
        return np.round(width * np.array([view.look.occluder_x, -view.look.occluder_y, 0.0]), DIGITS)
