# SPDX-License-Identifier: GPL-3.0-or-later
"""Between scene.headturn and the configuration that the command line reads."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy

from generator.errors import UsageError
from generator.plan.settings import Poses, Values
from generator.plan.variety import NONE

from .core.config import read_config, write_config
from .core.draws import draws_something, with_draws, without_draws
from .core.field import Get
from .core.fields import fields
from .core.found import HeadName
from .core.tables import Sections, check_shown, configuration, located, properties_of, section_of
from .session import Shown, quiet

VARIETY, DICE = "render_variety", "photo"
"""The property of the variety; which one the dice draw where none is chosen."""


def to_config(shown: Shown) -> Values:
    """The configuration that this scene shows, and what a loaded file held besides; paths are absolute."""
    return with_draws(_numbers(shown, _getter(shown)), shown.draws)


def look_config(shown: Shown) -> Values:
    """The same for the dice: where nothing is drawn, all is drawn as in photographs."""
    config = to_config(shown)
    return config if draws_something(config) else _numbers(shown, _of_variety(_getter(shown), DICE))


def still_config(shown: Shown) -> Values:
    """The same as the 3D view shows it: nothing is drawn."""
    return _numbers(shown, _of_variety(_getter(shown), NONE))


def from_config(shown: Shown, config: Values) -> None:
    """Show a configuration; what it does not say is as on the command line.

    Raises TypeError, ValueError or OverflowError if the panel cannot show a value.
    """
    config, draws = without_draws(config)
    with quiet():
        for field in fields():
            for name in field.properties():
                shown.property_unset(name)
        for name, value in properties_of(config).items():
            setattr(shown, name, value)
        shown.carried = json.dumps(config)
        shown.draws = draws
    check_shown(_getter(shown), config)


def load(shown: Shown, path: Path) -> None:
    """Read a configuration file. UsageError if it cannot be shown."""
    config = located(read_config(path), path.absolute().parent)
    before = to_config(shown)
    try:
        from_config(shown, config)
    except (TypeError, ValueError, OverflowError) as error:
        from_config(shown, before)
        raise UsageError(f"{path}: {' '.join(str(error).split())}") from error


def save(shown: Shown, path: Path) -> None:
    """Write the configuration of this scene. UsageError if the file cannot be written."""
    write_config(to_config(shown), path)


def poses(shown: Shown) -> Poses:
    """The [poses] of this scene, with an absolute path."""
    found: Poses = section_of(to_config(shown), "poses")
    return found


def planned(shown: Shown) -> Sections:
    """The sections of this scene that views follow from."""
    config = still_config(shown)
    return Sections(section_of(config, "render"), section_of(config, "poses"))


def pose(shown: Shown) -> tuple[float, float, float]:
    """(yaw, pitch, roll) that is shown, degrees."""
    return shown.yaw, shown.pitch, shown.roll


def radius_mm(shown: Shown) -> float:
    """Of the sphere about the pivot that holds the head in view, to the host's last digit."""
    return float(shown.radius)


def chosen_head(shown: Shown) -> HeadName:
    """The head that is chosen; another one is in view until the host has placed it."""
    return shown.subject, shown.expression


def is_of_scene(shown: Shown) -> bool:
    """Are the heads in a .blend?"""
    from generator.heads.head import is_scene

    return is_scene(str(to_config(shown).get("heads", {}).get("source", "")))


def absolute(path: str) -> str:
    """A path of a property; // is the folder of the .blend."""
    return str(Path(bpy.path.abspath(path)).absolute()) if path else ""


def _numbers(shown: Shown, get: Get) -> Values:
    return configuration(get, json.loads(shown.carried or "{}"))


def _of_variety(get: Get, variety: str) -> Get:
    return lambda name: variety if name == VARIETY else get(name)


def _getter(shown: Shown) -> Get:
    paths = {name for field in fields() for name in field.paths}

    def get(name: str) -> Any:
        value = getattr(shown, name)
        return absolute(value) if name in paths else value

    return get
