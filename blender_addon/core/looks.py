# SPDX-License-Identifier: GPL-3.0-or-later
"""What a throw of the dice showed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from generator.plan.settings import all_settings, value_text

from .words import titled

SEEDS = 10_000
"""A throw gives one below this: short enough to type."""

SHEET = 9
"""Looks on a sheet."""

_UNITS = {"degrees": "°", "pixels": " px"}


@dataclass(frozen=True)
class Look:
    """A look that is shown.

    head: (subject, expression). drawn: values by the key of their setting. left_out: what the head could not
    wear, and why.
    """

    head: tuple[str, str]
    pose: tuple[float, ...]
    seed: int
    drawn: dict[str, Any]
    left_out: str = ""

    def values(self) -> list[tuple[str, str]]:
        """What was drawn, for people: (name, value)."""
        known = {setting.key: setting for setting in all_settings() if setting.section == "render"}
        return [
            (titled(known[key].info.label) or key, f"{_text(value)}{_unit(known[key].info.unit)}")
            for key, value in self.drawn.items()
            if key in known
        ]


def _text(value: Any) -> str:
    """A colour has to fit into a narrow column."""
    return " ".join(f"{one:.2f}" for one in value) if isinstance(value, list) else value_text(value)


def _unit(name: str) -> str:
    return _UNITS.get(name, f" {name}") if name else ""
