# SPDX-License-Identifier: GPL-3.0-or-later
"""Between scene.headturn and the configuration that the command line reads."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import session
from .core.config import Config, merged, number, read_config, write_config

if TYPE_CHECKING:
    from .properties import HeadturnSettings

PARAMETRIC = "parametric"
RENDER = ("preset", "projection", "resolution", "lens_mm", "light_yaw_deg", "light_pitch_deg", "ambient")
DATASET = ("images", "image_format", "validation")
RANGES = ("yaw", "pitch", "roll")


def to_config(settings: HeadturnSettings) -> Config:
    """The configuration that this scene shows; what a loaded file held besides is kept."""
    shown: Config = {
        "heads": _heads(settings),
        "poses": poses_table(settings),
        "render": {name: _plain(getattr(settings, name)) for name in RENDER},
        "dataset": {name: _plain(getattr(settings, name)) for name in DATASET},
    }
    shown["render"]["background"] = [number(c) for c in settings.background]
    shown["render"]["distance_mm"] = None if settings.frame_head else number(settings.distance_mm)
    return merged(json.loads(settings.carried or "{}"), shown)


def from_config(settings: HeadturnSettings, config: Config) -> None:
    """Show a configuration. Raises TypeError or ValueError if a value does not fit."""
    heads, poses = config.get("heads", {}), config.get("poses", {})
    render, dataset = config.get("render", {}), config.get("dataset", {})
    with session.quiet():
        source = heads.get("source", PARAMETRIC)
        settings.source = "PARAMETRIC" if source == PARAMETRIC else "FOLDER"
        settings.folder = "" if source == PARAMETRIC else source
        values: dict[str, Any] = {
            name: heads[name] for name in ("count", "seed", "sampled_expressions") if name in heads
        }
        renamed = {
            "kind": "plan",
            "frame": "frame",
            "count": "pose_count",
            "seed": "pose_seed",
            "path": "csv_path",
        }
        values |= {renamed[name]: poses[name] for name in renamed if name in poses}
        for name in RANGES:
            if name in poses:
                step = getattr(settings, f"{name}_range")[2]
                values[f"{name}_range"] = (*poses[name], step)[:3]
        values |= {name: render[name] for name in (*RENDER, "background") if name in render}
        values |= {name: dataset[name] for name in DATASET if name in dataset}
        settings.frame_head = "distance_mm" not in render
        if not settings.frame_head:
            values["distance_mm"] = render["distance_mm"]
        for name, value in values.items():
            setattr(settings, name, value)
        settings.carried = json.dumps(config)


def load(settings: HeadturnSettings, path: Path) -> None:
    """Read a configuration file. UsageError if it cannot be shown."""
    from .core.errors import UsageError

    config = read_config(path)
    before = to_config(settings)
    try:
        from_config(settings, config)
    except (TypeError, ValueError) as error:
        from_config(settings, before)
        raise UsageError(f"{path}: {' '.join(str(error).split())}") from error


def save(settings: HeadturnSettings, path: Path) -> None:
    """Write the configuration of this scene. UsageError if the file cannot be written."""
    write_config(to_config(settings), path)


def poses_table(settings: HeadturnSettings) -> dict[str, Any]:
    """The [poses] table."""
    ends = 3 if settings.plan == "grid" else 2
    table: dict[str, Any] = {
        name: [number(v) for v in getattr(settings, f"{name}_range")][:ends] for name in RANGES
    }
    path = bpy.path.abspath(settings.csv_path) if settings.plan == "csv" and settings.csv_path else None
    return {
        "kind": settings.plan,
        "frame": settings.frame,
        **table,
        "count": settings.pose_count,
        "seed": settings.pose_seed,
        "path": path,
    }


def _heads(settings: HeadturnSettings) -> dict[str, Any]:
    if settings.source == "PARAMETRIC":
        return {
            "source": PARAMETRIC,
            "count": settings.count,
            "seed": settings.seed,
            "sampled_expressions": settings.sampled_expressions,
        }
    return {"source": str(Path(bpy.path.abspath(settings.folder)).absolute()) if settings.folder else ""}


def _plain(value: Any) -> Any:
    return number(value) if isinstance(value, float) else value
