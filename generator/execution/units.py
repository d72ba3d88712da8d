# SPDX-License-Identifier: GPL-3.0-or-later
"""Units of work: one head x one chunk of poses, named by everything that decides the content."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from generator.dataset.schema import SCHEMA_VERSION
from generator.execution.lane import head_to_json
from generator.execution.prepare import Prepared
from generator.geometry.camera import framing_distance
from generator.heads.head import Head
from generator.plan.config import BuildConfig
from generator.plan.poses import PosePlan


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
    return round(framing_distance(prepared.radius_mm, settings.lens_mm, settings.margin), 2)


def plan_units(
    heads: list[PlannedHead],
    plan: PosePlan,
    config: BuildConfig,
    *,
    root: Path,
    configuration_digest: str,
    versions: dict[str, str],
) -> list[dict[str, Any]]:
    """The build orders of every unit, head by head; see :class:`generator.execution.lane.Lane`.

    A unit's name is the hash of head files, placement, look, poses, detector and
    versions, so a part that is already there under that name needs no rebuilding.
    """
    settings = config.render.settings().as_dict()
    orders = []
    for planned in heads:
        for start in range(0, len(plan.angles_deg), config.dataset.unit_size):
            chunk = slice(start, start + config.dataset.unit_size)
            content = {
                "settings": settings,
                "prepared": planned.prepared.as_dict(),
                "distance_mm": planned.distance_mm,
                "poses": plan.angles_deg[chunk].tolist(),
                "indices": plan.indices[chunk].tolist(),
                "split": planned.split,
                "images": config.dataset.images,
                "image_format": config.dataset.image_format,
            }
            identity = {
                **content,
                "subject": planned.head.subject,
                "expression": planned.head.expression,
                "license": [planned.head.license, planned.head.redistributable],
                "files": planned.file_sha256,
                "landmarks": config.landmarks.model_dump(),
                "versions": versions,
                "schema": SCHEMA_VERSION,
            }
            name = hashlib.sha256(json.dumps(identity, sort_keys=True).encode()).hexdigest()[:16]
            orders.append(
                {
                    "op": "build",
                    "unit": name,
                    "head": head_to_json(planned.head),
                    "root": str(root),
                    "configuration_digest": configuration_digest,
                    **content,
                }
            )
    return orders
