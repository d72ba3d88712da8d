# SPDX-License-Identifier: GPL-3.0-or-later
"""A setting in Blender: which properties it has, and how they say its value."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

from generator.plan.setting import Setting

from .config import same
from .units import DEGREES, angle_of
from .words import HELP, titled

Get = Callable[[str], Any]
"""The value of a property, by its name."""


class Property(NamedTuple):
    """kind: which function of bpy.props makes it. options: its arguments."""

    kind: str
    options: dict[str, Any]


@dataclass(frozen=True)
class Field:
    """A setting in Blender. One class for each way a setting is shown; see fields.py."""

    setting: Setting

    @property
    def name(self) -> str:
        """Of its property."""
        return f"{self.setting.section}_{self.setting.key}"

    @property
    def drawn(self) -> str:
        """The property that is drawn."""
        return angle_of(self.name) if self.is_angle else self.name

    @property
    def style(self) -> str:
        """How rows.py draws it."""
        return "plain"

    @property
    def words(self) -> dict[str, str]:
        """Name and tooltip."""
        unit = f" ({self.setting.info.unit})" if self.setting.info.unit else ""
        help = HELP.get(self.setting.name, self.setting.info.help)
        return {"name": titled(self.setting.info.label), "description": f"{help}{unit}"}

    @property
    def is_angle(self) -> bool:
        """Is it shown by a second property, in radians? See units.py."""
        return self.setting.info.unit == DEGREES

    @property
    def optional(self) -> bool:
        """May it be left out?"""
        return type(None) in get_args(self.setting.kind)

    @property
    def kind(self) -> Any:
        """Its type, without None."""
        arguments = get_args(self.setting.kind)
        return next(a for a in arguments if a is not type(None)) if self.optional else self.setting.kind

    @property
    def paths(self) -> tuple[str, ...]:
        """Names of the properties that hold a path."""
        return ()

    def properties(self) -> dict[str, Property]:
        """Its properties by name."""
        raise NotImplementedError

    def value(self, get: Get) -> Any:
        """What the properties say, as TOML has it; None if it is not given."""
        return get(self.name)

    def properties_of(self, value: Any) -> dict[str, Any]:
        """The properties that say value, which may be anything that a file holds."""
        return {self.name: value}

    def shows(self, told: Any, value: Any) -> bool:
        """Is told what the properties show as value, as exactly as they can?"""
        return same(told, value)
