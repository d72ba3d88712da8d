# SPDX-License-Identifier: GPL-3.0-or-later
"""Distributions of numbers as one line of text, for the field Draws: Blender's numbers can hold none.

Written key=distribution with spaces between, as in ``lens_mm=uniform:28,135 background=uniform:0,1;0.5;0.5``.
Whether one is right is for the host to say. Settings that are texts have fields that hold a choice: itself.
"""

from __future__ import annotations

import shlex
from typing import Any

from generator.plan.distribution import is_distribution
from generator.plan.settings import Values, all_settings
from generator.plan.variety import NONE

SECTION = "render"


def without_draws(config: Values) -> tuple[Values, str]:
    """A configuration without its distributions of numbers, and the line that says them."""
    table, words = dict(config.get(SECTION, {})), []
    for key in _of_numbers():
        value = table.get(key)
        if isinstance(value, list) and any(map(is_distribution, value)):
            words.append(f"{key}={';'.join(map(_word, value))}")
        elif is_distribution(value):
            words.append(f"{key}={value}")
        else:
            continue
        del table[key]
    return ({**config, SECTION: table} if words else config), " ".join(words)


def with_draws(config: Values, line: str) -> Values:
    """A configuration with what a line says instead of what it says of these settings."""
    told = dict(_told(word) for word in _words(line))
    return {**config, SECTION: {**config.get(SECTION, {}), **told}} if told else config


def draws_something(config: Values) -> bool:
    """Is any image drawn differently from another?"""
    table = config.get(SECTION, {})
    others = (value for value in table.values() if isinstance(value, str) and "choice:" in value)
    return table.get("variety", NONE) != NONE or bool(without_draws(config)[1]) or any(others)


def _of_numbers() -> list[str]:
    return [s.key for s in all_settings() if s.section == SECTION and s.info.varies and s.kind is not str]


def _words(line: str) -> list[str]:
    try:
        return shlex.split(line)
    except ValueError:  # a quote without its end
        return line.split()


def _told(word: str) -> tuple[str, Any]:
    key, _, value = word.partition("=")
    return key, [_number(part) for part in value.split(";")] if ";" in value else value


def _number(part: str) -> float | str:
    try:
        return float(part)
    except ValueError:
        return part


def _word(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.9g}"
