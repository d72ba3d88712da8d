# SPDX-License-Identifier: GPL-3.0-or-later
"""Units of work: one head x one chunk of poses, named by everything that decides the content."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from generator.dataset.format.schema import SCHEMA_VERSION
from generator.execution.build.chunks import Chunk
from generator.execution.lanes.lane import head_to_json
from generator.geometry.camera import framing_distance
from generator.geometry.rotation import graphics_rotation
from generator.heads.head import Head
from generator.landmarks.anchors import Anchors, pack
from generator.placing.face import Prepared
from generator.plan.config import BuildConfig


@dataclass(frozen=True)
class PlannedHead:
    """A head that will be built, and what preparing it found."""

    head: Head
    prepared: Prepared
    file_sha256: tuple[tuple[str, str], ...]
    vertices: int
    triangles: int
    split: str
    distance_mm: float
    anchors: Anchors
    problems: tuple[str, ...] = ()


def assign_split(subject: str, validation: float) -> str:
    """Split of a subject: by its name alone, so more heads never move an old one."""
    share = int.from_bytes(hashlib.sha256(subject.encode()).digest()[:8], "big") / 2**64
    return "validation" if share < validation else "train"


def camera_distance(config: BuildConfig, prepared: Prepared) -> float:
    """Camera to pivot in mm, rounded to 0.01: as configured, or what frames this head."""
    settings = config.render.settings()
    if settings.distance_mm is not None:
        return settings.distance_mm
    return round(
        framing_distance(prepared.radius_mm, settings.lens_mm, settings.margin, settings.projection), 2
    )


def plan_units(
    heads: list[PlannedHead],
    chunks: Sequence[Chunk],
    config: BuildConfig,
    *,
    root: Path,
    configuration_digest: str,
    versions: dict[str, str],
) -> list[dict[str, Any]]:
    """The build orders of every unit, head by head; see :class:`generator.execution.lanes.lane.Lane`.

    A unit's name is the hash of head files, placement, look, poses, detector and
    versions, so a part that is already there under that name needs no rebuilding.
    "earlier_unit" is the name it had when its poses had another place in the grid.
    """
    settings = config.render.settings().as_dict()
    names = [_digest([chunk.poses, chunk.indices]) for chunk in chunks]
    earlier_names = [_digest([c.poses, c.earlier_indices]) if c.earlier_indices else None for c in chunks]
    orders = []
    for planned in heads:
        content = {
            "settings": settings,
            "prepared": planned.prepared.as_dict(),
            "anchors": pack(planned.anchors.turned(graphics_rotation(planned.prepared.levelling)), "<f8"),
            "distance_mm": planned.distance_mm,
            "split": planned.split,
            "images": config.dataset.images,
            "image_format": config.dataset.image_format,
            "passes": config.dataset.passes,
        }
        look = _digest(
            {
                **content,
                "subject": planned.head.subject,
                "expression": planned.head.expression,
                "license": [planned.head.license, planned.head.redistributable],
                "files": planned.file_sha256,
                "landmarks": config.landmarks.model_dump(),
                "versions": versions,
                "schema": SCHEMA_VERSION,
            }
        )
        head = head_to_json(planned.head)
        for chunk, name, earlier in zip(chunks, names, earlier_names, strict=True):
            orders.append(
                {
                    "op": "build",
                    "unit": _digest([look, name])[:16],
                    "earlier_unit": _digest([look, earlier])[:16] if earlier else None,
                    "head": head,
                    "root": str(root),
                    "configuration_digest": configuration_digest,
                    "poses": chunk.poses,
                    "indices": chunk.indices,
                    **content,
                }
            )
    return orders


def _digest(values: Any) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()
