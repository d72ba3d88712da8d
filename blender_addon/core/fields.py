# SPDX-License-Identifier: GPL-3.0-or-later
"""What each setting is in Blender: properties that follow from the table of settings.

A setting with a label has a property named section_key, such as render_lens_mm. Where one is not
enough there is a second one, whose name starts with that.
"""

from __future__ import annotations

from functools import lru_cache
from typing import get_args, get_origin

from generator.plan.setting import Setting
from generator.plan.settings import SECTIONS, section_settings

from .field import Field
from .numbers import Number
from .texts import Choice, Choices, Names, Source, Switch, Text


def field_of(setting: Setting) -> Field:
    """How a setting is shown. TypeError for one of a kind that nobody has met yet."""
    if setting.name == "heads.source":
        return Source(setting)
    plain = Field(setting)
    kind, several = plain.kind, get_origin(plain.kind) is tuple
    if kind is bool:
        return Choice(setting) if plain.optional else Switch(setting)
    countless = ... in get_args(kind) and setting.default is None  # Blender's lists have a length
    if kind in (int, float) or (several and {int, float} & set(get_args(kind)) and not countless):
        return Number(setting)
    if several and str in get_args(kind):
        return Choices(setting) if setting.choices else Names(setting)
    if setting.choices and not several:
        return Choice(setting)
    if kind is str:
        return Text(setting)
    raise TypeError(f"{setting.name}: Blender has no property for {setting.kind}")


def fields() -> tuple[Field, ...]:
    """Every setting that has a label, section by section, in the table's order."""
    return _fields(tuple(SECTIONS.items()))


@lru_cache(maxsize=4)
def _fields(sections: tuple[tuple[str, type], ...]) -> tuple[Field, ...]:
    every = (setting for name, section in sections for setting in section_settings(name, section))
    return tuple(field_of(setting) for setting in every if setting.info.label)
