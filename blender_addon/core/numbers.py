# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings that are numbers."""

from __future__ import annotations

import math
from typing import Any, get_args, get_origin

from generator.plan.setting import Setting

from .config import number
from .field import Field, Get, Property
from .units import OPTIONS
from .words import LIMITS, UNSET, WHERE_NOT_GIVEN, Unset


class Number(Field):
    """One or several ints or floats: a number, a range, or a colour if there are three between 0 and 1.

    Where it may be left out, a switch stands before it.
    """

    @property
    def style(self) -> str:
        return "numbers" if self._size and not self._is_colour else "number"

    @property
    def switch(self) -> str | None:
        """The property that leaves it out."""
        return f"{self.name}_unset" if self.optional else None

    def properties(self) -> dict[str, Property]:
        default, unset = self._start, self._unset
        options = {**self.words, "default": default, **_scale(self.setting, self._whole)}
        if self._size:
            options["size"] = self._size
        if self._is_colour:
            options["subtype"] = "COLOR_GAMMA"
        kind = f"{'Int' if self._whole else 'Float'}{'Vector' if self._size else ''}Property"
        made = {self.name: Property(kind, options)}
        if self.switch:
            words = {"name": unset.name, "description": unset.help}
            made[self.switch] = Property("BoolProperty", {**words, "default": self.setting.default is None})
        return made

    def value(self, get: Get) -> Any:
        if self.switch and get(self.switch):
            return None
        found = get(self.name)
        return [_typed(one) for one in found] if self._size else _typed(found)

    def properties_of(self, value: Any) -> dict[str, Any]:
        if self._size:
            value = (*value, *self._start[len(value) :])  # a range may lack its step
        return {self.name: value, **({self.switch: False} if self.switch else {})}

    @property
    def _size(self) -> int:
        """How many numbers; 0 for a single one that is no list."""
        if get_origin(self.kind) is not tuple:
            return 0
        return len(self.setting.default) if ... in get_args(self.kind) else len(get_args(self.kind))

    @property
    def _whole(self) -> bool:
        return int in (self.kind, *get_args(self.kind))

    @property
    def _is_colour(self) -> bool:
        return self._size == 3 and (self.setting.info.low, self.setting.info.high) == (0, 1)

    @property
    def _start(self) -> Any:
        """The properties' default, also where the setting's own is none."""
        if self.setting.default is not None:
            return self.setting.default
        return (self._unset.start,) * self._size if self._size else self._unset.start

    @property
    def _unset(self) -> Unset:
        ends = _scale(self.setting, self._whole)
        start = min(max(0, ends.get("min", 0)), ends.get("max", math.inf))
        return UNSET.get(self.setting.name, Unset(f"Default {self.words['name']}", WHERE_NOT_GIVEN, start))


def _scale(setting: Setting, whole: bool = False) -> dict[str, Any]:
    """Limits of a number, and how it is drawn."""
    info, reach = setting.info, LIMITS.get(setting.name)
    low, high = (info.low, info.high) if reach is None else (-reach, reach)
    if info.above is not None:
        # Blender knows no "more than".
        low = info.above + (1 if whole else max(1e-6, abs(info.above) * 1e-6))
    ends = {"min": low, "max": high}
    limits = {key: _whole_limit(end) if whole else end for key, end in ends.items() if end is not None}
    shown = {**limits, **OPTIONS.get(info.unit, {})}
    if whole:
        return shown
    if low is not None and 0 <= low < 1e-3 and high == 1:
        return {**shown, "subtype": "FACTOR"}
    return {**shown, **({"precision": 1, "step": 100} if info.unit in ("mm", "degrees") else {"step": 1})}


def _whole_limit(end: float) -> int:
    """Blender's whole numbers have 32 bits."""
    return min(int(end), 2**31 - 1)


def _typed(value: float) -> float | int:
    return number(value) if isinstance(value, float) else value
