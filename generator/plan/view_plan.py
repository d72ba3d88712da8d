# SPDX-License-Identifier: GPL-3.0-or-later
"""From settings and poses to views."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from generator import registries
from generator.errors import UsageError
from generator.geometry.camera import Camera, framing_distance, framing_lens
from generator.geometry.scene_camera import SceneCamera
from generator.plan.distribution import Distribution
from generator.plan.draws import draw_seed, person_of
from generator.plan.poses import pose_name
from generator.plan.render_settings import NOISE
from generator.plan.settings import Lens, Poses, Render, plain
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

    @property
    def drawn(self) -> Mapping[str, Distribution]:
        """What settings of render are drawn from, by "section.key"."""
        ...


def framed_camera(lens: Lens, radius_mm: float, scene_camera: SceneCamera | None = None) -> Camera:
    """The camera of a lens before a head.

    radius_mm: of the sphere about the pivot that holds the head. Its distance is the one that was
    asked for, or where the head just fits into the shorter side, rounded to 0.01 mm; with zoom, the focal
    length is what makes it fit. scene_camera: of the head's Blender scene, which takes the place of all that
    where the lens says so. Raises UsageError where it would stand inside of the head, or there is no such.
    """
    if lens.scene_camera:
        if scene_camera is None:
            raise UsageError("no camera of a Blender scene can be used here; remove --scene-camera")
        return scene_camera.at(lens.resolution)
    width, height = image_size(lens)
    # A lens is said for the width of the image, and the head has to fit into its shorter side.
    margin = lens.margin * width / min(width, height)
    focal, distance = lens.lens_mm, lens.distance_mm
    try:
        if distance is None:
            distance = round(framing_distance(radius_mm, focal, margin, lens.projection), 2)
        elif lens.zoom:
            focal = float(f"{framing_lens(radius_mm, distance, margin, lens.projection):.6g}")
    except ValueError as error:
        raise UsageError(f"{error}; give a larger --distance") from error
    principal = None
    if lens.shift_x or lens.shift_y:
        principal = (round(width * (0.5 + lens.shift_x), 3), round(height * (0.5 + lens.shift_y), 3))
    return Camera(width, height, focal, distance, lens.projection, principal)


def image_size(lens: Lens) -> tuple[int, int]:
    """Width and height of the images, pixels."""
    if lens.aspect >= 1:
        return lens.resolution, round(lens.resolution / lens.aspect)
    return round(lens.resolution * lens.aspect), lens.resolution


def plan_views(
    config: Planned,
    head: str,
    radius_mm: float,
    poses: Sequence[Pose],
    scene_camera: SceneCamera | None = None,
) -> Views:
    """The views of a head at some poses, the same for whoever asks: a build, verify, replay, a preview.

    head: subject/expression, on which draws depend. radius_mm, scene_camera: as in :func:`framed_camera`.
    """
    render = config.render
    if not (config.drawn or _is_random(render) or len(registries.DRAWS)):
        return Views(tuple(poses), (framed_camera(render, radius_mm, scene_camera),), (render.look,))
    views = []
    for pose in poses:
        drawn = drawn_render(config, head, pose)
        views.append(plan_view(config, drawn, head, radius_mm, pose, scene_camera))
    return Views.of(views)


def plan_view(
    config: Planned,
    render: Render,
    head: str,
    radius_mm: float,
    pose: Pose,
    scene_camera: SceneCamera | None = None,
) -> View:
    """The view of a head at a pose with the settings of its image, as :func:`drawn_render` draws them."""
    # Where nothing is random, views need no seed, and units have the name of any other.
    seed = view_seed(config.poses.seed, head, pose) if _is_random(render) else 0
    view = View(pose, framed_camera(render, radius_mm, scene_camera), render.look, seed)
    return _drawn(view, config.poses.seed, head)


def _is_random(render: Render) -> bool:
    return bool(render.noise) or render.backdrop == NOISE


def drawn_render(config: Planned, head: str, pose: Pose) -> Render:
    """The settings of one image: each that is a distribution is drawn.

    A draw depends on the seed, the setting's name and the person or, where each image has its own, the head
    and the pose: not on what else is drawn, nor on which images there are.
    """
    values: dict[str, Any] = {}
    for name, distribution in config.drawn.items():
        whose = (person_of(head),) if distribution.per_head else (head, pose_name(*pose))
        rng = np.random.default_rng(draw_seed(config.poses.seed, name, *whose))
        _, key, *place = name.split(".")
        value: Any = distribution.draw(rng)
        if place:
            numbers, k = values.get(key, getattr(config.render, key)), int(place[0])
            value = (*numbers[:k], value, *numbers[k + 1 :])
        values[key] = value
    return replace(config.render, **values)


def drawn_values(config: Planned, head: str, pose: Pose) -> dict[str, Any]:
    """What was drawn for one image, by the key of its setting, as JSON has it. See :func:`drawn_render`."""
    found = drawn_render(config, head, pose)
    return {key: plain(getattr(found, key)) for key in dict.fromkeys(n.split(".")[1] for n in config.drawn)}


def view_seed(seed: int, head: str, pose: Pose) -> int:
    """The seed of what is random in one image."""
    start, drawn = draw_seed(seed, "picture", head, pose_name(*pose))
    return drawn ^ start


def _drawn(view: View, seed: int, head: str) -> View:
    pose = pose_name(*view.pose)
    for name in registries.DRAWS:
        draw: Draw = registries.DRAWS.get(name)
        view = draw(view, np.random.default_rng(draw_seed(seed, name, head, pose)))
    return view
