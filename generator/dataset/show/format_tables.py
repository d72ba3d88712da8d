# SPDX-License-Identifier: GPL-3.0-or-later
"""Formats of exports, passes and factors as tables for people, in docs/."""

from __future__ import annotations

from generator.dataset.export.options import Format
from generator.dataset.format.missing import MISSING
from generator.dataset.show.column_tables import markdown_table
from generator.plan.factors import FACTORS
from generator.plan.passes import Pass
from generator.registries import FORMATS, PASSES


def _formats() -> dict[str, Format]:
    return {name: FORMATS.get(name) for name in FORMATS}


def formats_table() -> str:
    """For whom each format is, and what it holds."""
    rows = [(f"`{name}`", chosen.readers, chosen.holds) for name, chosen in _formats().items()]
    return markdown_table(("format", "for", "holds"), rows)


def rotations_table() -> str:
    """Which rotation stands where, and how it gives R_C again."""
    rows = [(name, chosen.written, chosen.back) for name, chosen in _formats().items()]
    return markdown_table(("format", "what is written", "R_C again"), rows)


def missing_table() -> str:
    """What each format can do about rows without a detection or landmarks."""
    formats = _formats()
    rows = []
    for choice, meaning in MISSING.items():
        taken = [name for name, chosen in formats.items() if choice in chosen.missing]
        default = [name for name, chosen in formats.items() if choice == chosen.missing[0]]
        if taken:
            rows.append((f"`{choice}`", meaning, _all_or_named(taken), ", ".join(default)))
    return markdown_table(("`--missing`", "meaning", "formats", "default of"), rows)


def passes_table() -> str:
    """The layers of a file of passes."""
    known: list[Pass] = [PASSES.get(name) for name in PASSES]
    rows = [(f"`{one.name}`", " ".join(one.channels), one.meaning) for one in known]
    return markdown_table(("layer", "channels", "meaning"), rows)


def factors_table() -> str:
    """What twins may change, and what they draw."""
    rows = []
    for factor in FACTORS.values():
        drawn = [f"`{key}` {text}" for key, text in {**factor.draws, **factor.along}.items() if text]
        others = [f"`{key}`" for key, text in factor.draws.items() if not text]
        where = [f"where the configuration draws it, {', '.join(others)}"] if others else []
        rows.append((f"`{factor.name}`", factor.meaning, "; ".join([", ".join(drawn)] * bool(drawn) + where)))
    return markdown_table(("factor", "what changes", "drawn from"), rows)


def _all_or_named(names: list[str]) -> str:
    return "all" if len(names) == len(FORMATS) else ", ".join(names)
