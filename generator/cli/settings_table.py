# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of settings for people: docs/configuration.md."""

from __future__ import annotations

from typing import Any, get_args, get_origin

from generator.plan.setting import Setting
from generator.plan.settings import ROWS, SECTIONS, section_settings


def section_table(name: str) -> str:
    """The settings of one section as Markdown."""
    header = ["setting", "option", "value", "default", "meaning"]
    rows = [_row(setting) for setting in section_settings(name, SECTIONS[name])]
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _row(setting: Setting) -> list[str]:
    info = setting.info
    marks = []
    if info.grows:
        marks.append("a dataset may grow along it")
    if setting.section not in ROWS and not info.content:
        marks.append("does not change pixels or labels")
    if info.varies:
        marks.append("may be a distribution")
    if info.path:
        marks.append("a relative path counts from the configuration file")
    choices = "; ".join(f"`{c.value}`: {c.help[0].lower()}{c.help[1:]}" for c in setting.choices if c.help)
    meaning = info.help + (f" ({choices})" if choices else "") + (f". *{'; '.join(marks)}*" if marks else "")
    return [
        f"`{setting.key}`",
        f"`{setting.flag}`" if setting.flag else "",
        _value(setting),
        _default(setting.default),
        meaning,
    ]


def _value(setting: Setting) -> str:
    info, kind = setting.info, _plain_kind(setting.kind)
    if setting.choices:
        values = ", ".join(f"`{choice.value}`" for choice in setting.choices)
        return f"list of {values}" if kind == "list of text" else values
    limits = []
    if info.above is not None:
        limits.append(f"above {info.above:g}")
    if info.low is not None:
        limits.append(f"from {info.low:g}")
    if info.high is not None:
        limits.append(f"to {info.high:g}")
    unit = f" {info.unit}" if info.unit else ""
    return " ".join([f"{kind}{unit}", *limits])


def _plain_kind(kind: Any) -> str:
    inner = [a for a in get_args(kind) if a is not type(None)]
    if type(None) in get_args(kind):
        return _plain_kind(inner[0])
    if get_origin(kind) is tuple:
        words = {"text": "list of text", "number": "numbers"}
        word = words[_plain_kind(inner[0])]
        return f"{len(inner)} {word}" if inner[-1] is not ... else word
    return {int: "whole number", float: "number", bool: "true or false"}.get(kind, "text")


def _default(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, tuple):
        return f"`[{', '.join(f'{v:g}' if isinstance(v, float) else str(v) for v in value)}]`"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"
