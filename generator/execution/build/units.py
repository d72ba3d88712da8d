# SPDX-License-Identifier: GPL-3.0-or-later
"""From heads and poses to units of work, named by what decides their content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from generator.codec import to_plain
from generator.content import deciding
from generator.errors import UsageError
from generator.execution.build.chunks import Chunk, ChunkedPoses, Indices
from generator.geometry.camera import Camera
from generator.geometry.rotation import graphics_rotation
from generator.heads.head import SCENE, Head
from generator.heads.placement import Placement
from generator.landmarks.anchors import Anchors
from generator.messages import BuildOrder
from generator.picture.scenery import folders_of
from generator.plan.config import BuildConfig
from generator.plan.settings import ROWS, beyond_defaults
from generator.plan.twins import plan_twins, planned_twins
from generator.plan.view_plan import framed_camera, plan_views
from generator.plan.views import Views


@dataclass(frozen=True)
class PlannedHead:
    """A head that will be built, and what placing it found.

    camera: that frames it; views may have others.
    """

    head: Head
    placement: Placement
    file_sha256: tuple[tuple[str, str], ...]
    vertices: int
    triangles: int
    split: str
    camera: Camera
    anchors: Anchors
    problems: tuple[str, ...] = ()

    @property
    def points(self) -> np.ndarray:
        """The anchors at the pose zero of the dataset, float64 [P, 3], frame C, mm."""
        return self.anchors.turned(graphics_rotation(self.placement.levelling))


def assign_split(subject: str, validation: float) -> str:
    """Split of a subject: by its name alone, so more heads never move an old one."""
    share = int.from_bytes(hashlib.sha256(subject.encode()).digest()[:8], "big") / 2**64
    return "validation" if share < validation else "train"


def head_camera(config: BuildConfig, placement: Placement) -> Camera:
    """The camera that frames a head. Raises UsageError: it is to be that of its scene, which has none."""
    if config.render.scene_camera and placement.no_camera:
        raise UsageError(f"--scene-camera: {placement.no_camera}; correct that in Blender, or remove it")
    return framed_camera(config.render, placement.radius_mm, placement.scene_camera)


def plan_units(
    heads: Sequence[PlannedHead],
    poses: ChunkedPoses,
    config: BuildConfig,
    *,
    root: Path,
    configuration_digest: str,
    versions: Mapping[str, str],
) -> list[BuildOrder]:
    """The build orders of every unit, head by head.

    A unit's name is the hash of everything that decides its content: the content version and the
    libraries, head files, placement, views, settings that are not the default. So a part that is
    already there under that name needs no rebuilding.
    """
    settings = beyond_defaults(config.as_dict(), lambda s: s.info.content and s.section not in ROWS)
    orders = []
    for planned in heads:
        head, points = planned.head, planned.points
        fixed = _digest(
            {
                "versions": deciding(versions),
                "subject": head.subject,
                "expression": head.expression,
                "license": [head.license, head.redistributable],
                "files": planned.file_sha256,
                "placement": to_plain(planned.placement),
                "anchors": to_plain(points),
                "split": planned.split,
                "settings": settings,
                **({"without": head.without} if head.without else {}),
                **({"scene": [head.head_object, head.shape_key]} if head.source == SCENE else {}),
            }
        )
        for chunk in poses.of(head.subject, head.expression):
            place = planned.placement
            views = plan_views(config, head.name, place.radius_mm, chunk.poses, place.scene_camera)
            seen = [to_plain(views.cameras), to_plain(views.looks)]
            if any(views.seeds):
                seen.append(list(views.seeds))

            def name(indices: Any, chunk: Chunk = chunk, seen: Any = seen, fixed: str = fixed) -> str:
                return _digest([fixed, seen, chunk.poses, indices])[:16]

            before = [name(chunk.earlier_indices)] if chunk.earlier_indices else []
            order = build_order(
                head, planned.placement, points, planned.split, views, chunk.indices, config, root
            )
            order = replace(
                order,
                unit=name(chunk.indices),
                configuration_digest=configuration_digest,
                earlier_units=tuple(before),
            )
            orders.append(order)
            if config.dataset.twins:
                orders += _twin_orders(order, planned, chunk, config, fixed)
    return orders


def _twin_orders(
    order: BuildOrder, planned: PlannedHead, chunk: Chunk, config: BuildConfig, fixed: str
) -> Iterator[BuildOrder]:
    """The orders of a unit's twins, one a factor: so a factor more is units more, and changes none."""
    head, place = order.head.name, planned.placement
    for factor, places in planned_twins(config, head, chunk.poses):
        poses = tuple(chunk.poses[k] for k in places)
        views = plan_twins(config, head, place.radius_mm, poses, factor, place.scene_camera)
        seen = [to_plain(views.cameras), to_plain(views.looks), list(views.seeds)]
        now, before = (
            tuple(indices[k] for k in places) if indices else None
            for indices in (chunk.indices, chunk.earlier_indices)
        )
        unit, *earlier = (
            _digest([fixed, seen, poses, indices, factor])[:16] for indices in (now, before) if indices
        )
        yield replace(
            order,
            unit=unit,
            earlier_units=tuple(earlier),
            views=views,
            indices=now or (),
            factor=factor,
        )


def build_order(
    head: Head,
    placement: Placement,
    points: np.ndarray,
    split: str,
    views: Views,
    indices: tuple[Indices, ...],
    config: BuildConfig,
    root: Path,
) -> BuildOrder:
    """An order for some views of a placed head, without a name yet. points: see BuildOrder.anchors."""
    folders = folders_of(config)
    return BuildOrder(
        unit="unnamed",
        head=head,
        root=str(root),
        views=views,
        indices=indices,
        placement=placement,
        anchors=points,
        split=split,
        images=config.dataset.images,
        image_format=config.dataset.image_format,
        passes=config.dataset.passes,
        landmarks=config.detecting,
        environments=folders.environments,
        pictures=folders.pictures,
        things=folders.things,
    )


def _digest(values: Any) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
