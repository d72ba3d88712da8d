# SPDX-License-Identifier: GPL-3.0-or-later
"""Between Blender's properties and the tables of a configuration, setting by setting."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from dataclasses import field as default
from pathlib import Path
from typing import Any

from generator.plan.distribution import Distribution
from generator.plan.head_source import is_made, split_path
from generator.plan.settings import (
    PARAMETRIC,
    SECTIONS,
    Poses,
    Render,
    Values,
    all_settings,
    plain,
    with_defaults,
)
from generator.plan.variety import VARIETY

from .config import same
from .field import Field, Get
from .fields import fields

GRID, TABLE = "grid", "csv"


@dataclass(frozen=True)
class Sections:
    """What views follow from; see :class:`generator.plan.view_plan.Planned`."""

    render: Render
    poses: Poses
    drawn: Mapping[str, Distribution] = default(default_factory=dict)


def _made(values: Values) -> bool:
    return is_made(_told(values, "heads", "source", PARAMETRIC))


def _kind(values: Values) -> str:
    return str(_told(values, "poses", "kind", GRID))


def is_gridded(values: Values) -> bool:
    """Are the poses those of a grid?"""
    return _kind(values) == GRID


def is_drawn(values: Values) -> bool:
    """Are the poses random?"""
    return _kind(values) not in (GRID, TABLE)


_APPLIES: dict[str, Callable[[Values], bool]] = {
    **dict.fromkeys(("heads.count", "heads.seed", "heads.sampled_expressions"), _made),
    **dict.fromkeys(
        (
            *("heads.units", "heads.eye_distance_mm", "heads.up", "heads.forward"),
            *("heads.license", "heads.redistributable"),
        ),
        lambda values: not _made(values),
    ),
    **dict.fromkeys(("poses.yaw", "poses.pitch", "poses.roll"), lambda values: _kind(values) != TABLE),
    **dict.fromkeys(("poses.count", "poses.seed", "poses.same"), is_drawn),
    "poses.path": lambda values: _kind(values) == TABLE,
}
"""Settings that mean something for some heads or poses only. Others always do."""


def applies(field: Field, values: Values) -> bool:
    """Does a setting mean anything beside these values?"""
    return field.setting.name not in _APPLIES or _APPLIES[field.setting.name](values)


def configuration(get: Get, told: Values) -> Values:
    """What the properties say, with what a loaded file told besides.

    get: paths are absolute. Blender's numbers have 32 bits: where a property shows what the file told, the
    file's own digits stay. A setting that means nothing here is left out, unless it meant nothing in
    the file either; and one that nobody has touched, where the variety draws it.
    """
    result = {name: dict(table) for name, table in told.items()}
    drawn = VARIETY.get(get("render_variety"), {})
    for field, value in _shown(get, told):
        section, key = field.setting.section, field.setting.key
        table = result.setdefault(section, {})
        left = section == "render" and key in drawn and key not in told.get(section, {})
        if value is None or (left and same(value, plain(field.setting.default))):
            table.pop(key, None)
        elif key not in table or not field.shows(table[key], value):
            table[key] = value
    return {name: result[name] for name in SECTIONS if result.get(name)}


def properties_of(config: Values) -> dict[str, Any]:
    """The properties that say what a file told. ValueError, which names the setting, if they cannot."""
    found: dict[str, Any] = {}
    for field in fields():
        value = config.get(field.setting.section, {}).get(field.setting.key)
        if value is not None:
            try:
                found |= field.properties_of(value)
            except (TypeError, ValueError) as error:
                raise ValueError(f"{field.setting.name}: the panel cannot show {value!r}") from error
    return found


def check_shown(get: Get, told: Values) -> None:
    """Do the properties show what a file told? Blender moves a number that is out of range to its end.

    Raises ValueError, which names the setting.
    """
    for field, value in _shown(get, told):
        given = told.get(field.setting.section, {}).get(field.setting.key)
        if given is not None and value is not None and not field.shows(given, value):
            raise ValueError(f"{field.setting.name}: the panel cannot show {given!r}")


def located(config: Values, base: Path) -> Values:
    """A configuration whose paths count from base, with absolute ones."""
    result = {name: dict(table) for name, table in config.items()}
    for setting in all_settings():
        value = result.get(setting.section, {}).get(setting.key)
        if setting.info.path and isinstance(value, str) and (path := split_path(value)[1]):
            result[setting.section][setting.key] = split_path(value)[0] + str((base / path).absolute())
    return result


def section_of(config: Values, name: str) -> Any:
    """The section as the generator has it, such as a Render: what the tables leave out is the default."""
    return SECTIONS[name](**{key: _frozen(value) for key, value in with_defaults(config)[name].items()})


def _shown(get: Get, told: Values) -> list[tuple[Field, Any]]:
    """What the properties say of each setting; None if it is to be left out."""
    values = {field: field.value(get) for field in fields()}
    tables: Values = {name: {} for name in SECTIONS}
    for field, value in values.items():
        tables[field.setting.section][field.setting.key] = value
    found = []
    for field, value in values.items():
        if applies(field, tables):
            if field.setting.section == "poses" and is_drawn(tables) and isinstance(value, list):
                value = _ends(field, value, told)
            found.append((field, value))
        elif applies(field, told):
            found.append((field, None))
    return found


def _ends(field: Field, value: list[Any], told: Values) -> list[Any]:
    """The ends of a range of random poses: they need no step, but a file, or the default, may name one."""
    if is_drawn(told):
        given = told.get("poses", {}).get(field.setting.key)
        if isinstance(given, list) and same(given, value[: len(given)]):
            return value[: len(given)]
    return value if same(value, field.setting.default) else value[:2]


def _told(values: Values, section: str, key: str, default: Any) -> Any:
    found = values.get(section, {}).get(key)
    return default if found is None else found


def _frozen(value: Any) -> Any:
    return tuple(map(_frozen, value)) if isinstance(value, list) else value
