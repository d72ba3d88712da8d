# SPDX-License-Identifier: GPL-3.0-or-later
"""Twins: the same head and pose as a row, with one factor changed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from typing import Any, Protocol

import numpy as np

from generator.errors import UsageError
from generator.geometry.camera import framed_margin
from generator.geometry.scene_camera import SceneCamera
from generator.plan.distribution import TRIES, Distribution, is_choice, parse_choice, parse_distribution
from generator.plan.draws import draw_seed, person_of
from generator.plan.factors import FACTORS, Factor
from generator.plan.poses import pose_name
from generator.plan.settings import Dataset, Render, section_settings
from generator.plan.view_plan import Planned, drawn_render, plan_view
from generator.plan.views import Pose, Views

ROOM = 1.5
"""A camera that a twin draws is at least so many radii of the framed head away."""

_DEFAULTS: dict[str, Any] = {one.name: one.default for one in fields(Render)}
_LIMITS = {one.key: (one.info.low, one.info.high) for one in section_settings("render", Render)}


class PlannedTwins(Planned, Protocol):
    """What twins follow from: a :class:`generator.plan.config.BuildConfig`."""

    @property
    def dataset(self) -> Dataset:
        """Which factors have twins, and what share of the rows."""
        ...


def twin_factors(config: PlannedTwins) -> tuple[str, ...]:
    """The factors that have twins, none twice. Raises UsageError for one that could change nothing."""
    factors = tuple(dict.fromkeys(config.dataset.twins))
    if any(FACTORS[name].camera for name in factors) and config.render.projection == "orthographic":
        raise UsageError("dataset.twins: without perspective another lens changes nothing; leave lens out")
    for factor in (FACTORS[name] for name in factors):
        given = any(f"render.{key}" in config.drawn for key in factor.draws)
        if not any(factor.draws.values()) and not given and is_plain(config.render, factor):
            keys = " or ".join(f"render.{key}" for key in factor.draws)
            raise UsageError(f"dataset.twins: nothing says which {factor.name} a twin has; give {keys}")
    return factors


def has_twin(config: PlannedTwins, head: str, pose: Pose, factor: str) -> bool:
    """Has the row of a head (subject/expression) at a pose a twin with this factor changed?

    A draw for each row and factor: other heads, poses and factors change none, and a larger share adds some.
    """
    share = config.dataset.twins_share
    drawn = draw_seed(config.poses.seed, "twins", factor, head, pose_name(*pose))[1]
    return drawn / 2**64 < share


def planned_twins(config: PlannedTwins, head: str, poses: Sequence[Pose]) -> Iterator[tuple[str, list[int]]]:
    """Each factor of which some rows of a head have twins, and the places of their poses."""
    for factor in twin_factors(config):
        if places := [k for k, pose in enumerate(poses) if has_twin(config, head, pose, factor)]:
            yield factor, places


def plan_twins(
    config: PlannedTwins,
    head: str,
    radius_mm: float,
    poses: Sequence[Pose],
    factor: str,
    scene_camera: SceneCamera | None = None,
) -> Views:
    """The views of the twins of a head's rows; see :func:`generator.plan.view_plan.plan_views`."""
    views = []
    for pose in poses:
        render = twin_render(config, head, radius_mm, pose, FACTORS[factor])
        views.append(plan_view(config, render, head, radius_mm, pose, scene_camera))
    return Views.of(views)


def is_plain(render: Render, factor: Factor) -> bool:
    """Do the settings of a factor have their defaults in an image?"""
    return all(getattr(render, key) == _DEFAULTS[key] for key in factor.draws)


def twin_render(config: Planned, head: str, radius_mm: float, pose: Pose, factor: Factor) -> Render:
    """The settings of a row's twin: plain where the row is not, else drawn until they are not plain.

    A draw depends on the seed, the row and the name of the setting alone, as every draw. It is from what the
    configuration draws the setting from, if it does, else from what the factor says.
    """
    base = drawn_render(config, head, pose)
    if not is_plain(base, factor):
        plain: dict[str, Any] = {key: _DEFAULTS[key] for key in factor.draws}
        twin = replace(base, **plain)
        return _same_share(base, twin, radius_mm) if factor.camera else twin
    twin = _drawn(config, config.drawn, head, pose, factor, base)
    if is_plain(twin, factor):  # whatever the configuration draws is plain, too
        twin = _drawn(config, {}, head, pose, factor, base)
    if not factor.camera or twin.distance_mm is None:
        return twin
    nearest = ROOM * base.margin * max(base.aspect, 1.0) * radius_mm
    return replace(twin, zoom=True, distance_mm=max(twin.distance_mm, round(nearest, 2)))


def _drawn(
    config: Planned,
    given: Mapping[str, Distribution],
    head: str,
    pose: Pose,
    factor: Factor,
    base: Render,
) -> Render:
    """The base with every setting of the factor drawn, again and again while it is plain."""
    sources = {
        key: given.get(f"render.{key}") or (_parsed(key, text) if text else None)
        for key, text in {**factor.draws, **factor.along}.items()
    }
    drawing = []
    for key, source in sources.items():
        if source is not None:
            name = f"render.{key}"
            whose = (person_of(head),) if source.per_head else (head, pose_name(*pose))
            seed = draw_seed(config.poses.seed, name, *whose, "twin")
            drawing.append((key, source, np.random.default_rng(seed)))
    twin = base
    for _ in range(TRIES):
        values: dict[str, Any] = {key: source.draw(rng) for key, source, rng in drawing}
        twin = replace(base, **values)
        if not is_plain(twin, factor):
            break
    return twin


def _parsed(key: str, text: str) -> Distribution:
    if is_choice(text) and isinstance(_DEFAULTS[key], str):
        return parse_choice(text)
    return parse_distribution(text, *_LIMITS[key])


def _same_share(base: Render, twin: Render, radius_mm: float) -> Render:
    """The twin with the margin that the base has, where that follows from its lens and distance."""
    if base.distance_mm is None or base.zoom:
        return twin
    margin = framed_margin(radius_mm, base.lens_mm, base.distance_mm, base.projection)
    return replace(twin, margin=float(f"{margin / max(base.aspect, 1.0):.6g}"))
