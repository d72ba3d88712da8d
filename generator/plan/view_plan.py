# SPDX-License-Identifier: GPL-3.0-or-later
"""From settings and poses to views."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from generator import registries
from generator.geometry.camera import Camera, framing_distance
from generator.plan.draws import draw_seed
from generator.plan.poses import pose_name
from generator.plan.settings import Lens, Poses, Render
from generator.plan.views import Pose, View, Views

Draw = Callable[[View, np.random.Generator], View]
"""What makes one view differ from the next; see :data:`generator.registries.DRAWS`."""


class Planned(Protocol):
    """What views follow from: a :class:`generator.plan.config.BuildConfig`."""

    @property
    def render(self) -> Render:
        """How images are made."""
        ...

    @property
    def poses(self) -> Poses:
        """Whose seed draws depend on."""
        ...


def framed_camera(lens: Lens, radius_mm: float) -> Camera:
    """The camera of a lens before a head.

    radius_mm: of the sphere about the pivot that holds the head. Its distance is the one that was
    asked for, or where the head just fits, rounded to 0.01 mm.
    """
    distance = lens.distance_mm
    if distance is None:
        distance = round(framing_distance(radius_mm, lens.lens_mm, lens.margin, lens.projection), 2)
    return Camera.square(lens.resolution, lens.lens_mm, distance, lens.projection)


def plan_views(config: Planned, head: str, radius_mm: float, poses: Sequence[Pose]) -> Views:
    """The views of a head at some poses, the same for whoever asks: a build, verify, replay, a preview.

    head: subject/expression, on which draws depend. radius_mm: as in :func:`framed_camera`.
    """
    render = config.render
    views = Views(tuple(poses), (framed_camera(render, radius_mm),), (render.look,))
    if not len(registries.DRAWS):
        return views
    return Views.of([_drawn(view, config.poses.seed, head) for view in views])


def _drawn(view: View, seed: int, head: str) -> View:
    pose = pose_name(*view.pose)
    for name in registries.DRAWS:
        draw: Draw = registries.DRAWS.get(name)
        view = draw(view, np.random.default_rng(draw_seed(seed, name, head, pose)))
    return view
