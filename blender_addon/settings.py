# SPDX-License-Identifier: GPL-3.0-or-later
"""Between scene.headturn and the configuration that the command line reads."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy

from . import session
from .core.config import (
    Config,
    join_names,
    merged,
    number,
    read_config,
    same,
    split_names,
    write_config,
)

if TYPE_CHECKING:
    from .properties import HeadturnSettings

PARAMETRIC = "parametric"
GUESS = "GUESS"
RENDER = ("preset", "projection", "resolution", "lens_mm", "light_yaw_deg", "light_pitch_deg", "ambient")
DATASET = ("images", "image_format", "validation")
RANGES = ("yaw", "pitch", "roll")
MADE = ("count", "seed", "sampled_expressions")
LISTS = {"subjects": "only_subjects", "expressions": "only_expressions"}
MESHES = ("units", "up", "forward")
POSES = {"kind": "plan", "frame": "frame", "count": "pose_count", "seed": "pose_seed", "path": "csv_path"}
SHOWN = (
    *("source", "folder", *MADE, *LISTS.values(), *MESHES, *POSES.values()),
    *(f"{name}_range" for name in RANGES),
    *(*RENDER, "background", "frame_head", "distance_mm", *DATASET),
)
"""Every setting of the scene that belongs to the configuration."""


def to_config(settings: HeadturnSettings) -> Config:
    """The configuration that this scene shows; what a loaded file held besides is kept."""
    return merged(json.loads(settings.carried or "{}"), _shown(settings))


def from_config(settings: HeadturnSettings, config: Config) -> None:
    """Show a configuration; what it does not say is as on the command line.

    Raises TypeError, ValueError or OverflowError if the panel cannot show a value.
    """
    heads, poses = config.get("heads", {}), config.get("poses", {})
    render, dataset = config.get("render", {}), config.get("dataset", {})
    with session.quiet():
        for name in SHOWN:
            settings.property_unset(name)
        source = heads.get("source", PARAMETRIC)
        settings.source = "PARAMETRIC" if source == PARAMETRIC else "FOLDER"
        settings.folder = "" if source == PARAMETRIC else source
        values: dict[str, Any] = {name: heads[name] for name in (*MADE, *MESHES) if name in heads}
        values |= {LISTS[name]: join_names(heads[name]) for name in LISTS if name in heads}
        values |= {POSES[name]: poses[name] for name in POSES if name in poses}
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
    # Blender moves a number that is out of range to the end of the range.
    for section, table in _shown(settings).items():
        for key, value in table.items():
            told = config.get(section, {}).get(key)
            checked = value is not None and told is not None and key not in ("source", "path")
            if checked and not same(told, value):
                raise ValueError(f"{section}.{key}: the panel cannot show {told!r}")


def load(settings: HeadturnSettings, path: Path) -> None:
    """Read a configuration file. UsageError if it cannot be shown."""
    from .core.errors import UsageError

    config = read_config(path)
    before = to_config(settings)
    try:
        from_config(settings, config)
    except (TypeError, ValueError, OverflowError) as error:
        from_config(settings, before)
        raise UsageError(f"{path}: {' '.join(str(error).split())}") from error


def save(settings: HeadturnSettings, path: Path) -> None:
    """Write the configuration of this scene. UsageError if the file cannot be written."""
    write_config(to_config(settings), path)


def poses_table(settings: HeadturnSettings) -> dict[str, Any]:
    """The [poses] table."""
    told = json.loads(settings.carried or "{}").get("poses", {})
    table: dict[str, Any] = {}
    for name in RANGES:  # random plans need no step, but a file may name one
        ends = 3 if settings.plan == "grid" else len(told.get(name, "ab"))
        table[name] = [number(v) for v in getattr(settings, f"{name}_range")][:ends]
    return {
        "kind": settings.plan,
        "frame": settings.frame,
        **table,
        "count": settings.pose_count,
        "seed": settings.pose_seed,
        "path": _absolute(settings.csv_path) or None,
    }


def _shown(settings: HeadturnSettings) -> Config:
    shown: Config = {
        "heads": _heads(settings),
        "poses": poses_table(settings),
        "render": {name: _plain(getattr(settings, name)) for name in RENDER},
        "dataset": {name: _plain(getattr(settings, name)) for name in DATASET},
    }
    shown["render"]["background"] = [number(c) for c in settings.background]
    shown["render"]["distance_mm"] = None if settings.frame_head else number(settings.distance_mm)
    return shown


def _heads(settings: HeadturnSettings) -> dict[str, Any]:
    table: dict[str, Any] = {name: split_names(getattr(settings, LISTS[name])) for name in LISTS}
    if settings.source == "PARAMETRIC":
        made = {name: getattr(settings, name) for name in MADE}
        return {"source": PARAMETRIC, **made, **table, **dict.fromkeys(MESHES)}
    for name in MESHES:
        value = getattr(settings, name)
        table[name] = None if value == GUESS else value
    return {"source": _absolute(settings.folder), **table}


def _absolute(path: str) -> str:
    return str(Path(bpy.path.abspath(path)).absolute()) if path else ""


def _plain(value: Any) -> Any:
    return number(value) if isinstance(value, float) else value
