# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel shows: which settings, in which rows, and the lines between them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from generator.errors import HeadturnError
from generator.plan.settings import SECTIONS, Values

from .build import Build
from .conversation import Conversation
from .field import Field
from .fields import fields
from .state import HeadName, State
from .tables import applies, is_drawn, section_of

SKIPPED_SHOWN = 3

SELECTION = (
    *("heads.subjects", "heads.expressions"),
    *("heads.units", "heads.eye_distance_mm", "heads.up", "heads.forward"),
)
"""Settings in a panel of their own, which is closed at first."""

OWN_PANEL = ("heads", "poses", "render")
"""Sections with a panel of their own; those of all others stand beside the Build button."""


class Line(NamedTuple):
    """A line of text. icon: a name of Blender's, "NONE" for none."""

    text: str
    icon: str


@dataclass(frozen=True)
class Row:
    """A setting in the panel. parts: how many of its numbers are shown; 0 for all."""

    field: Field
    parts: int = 0


def rows(sections: tuple[str, ...], values: Values, *, selection: bool | None = None) -> list[Row]:
    """The rows of some sections, in the table's order: the settings that mean something beside these values.

    selection: those of the panel Selection alone, or those that are not in it; None for both.
    """
    return [
        Row(field, parts=_parts(field, values))
        for field in fields()
        if field.setting.section in sections
        and applies(field, values)
        and (selection is None or (field.setting.name in SELECTION) is selection)
    ]


def other_sections() -> tuple[str, ...]:
    """Sections that have no panel of their own."""
    return tuple(name for name in SECTIONS if name not in OWN_PANEL)


def going_on(conversation: Conversation) -> Line | None:
    """What went wrong last, or what is going on."""
    if conversation.state.error:
        return Line(conversation.state.error, "ERROR")
    return Line(conversation.busy, "SORTTIME") if conversation.busy else None


def found(state: State) -> Line:
    """How many heads there are."""
    return Line(f"{len(state.heads)} heads of {len(state.subjects())} subjects", "INFO")


def in_view(state: State, chosen: HeadName) -> list[Line]:
    """Of the head in view: its vertices and what is to be said of it, or its name if another is chosen."""
    if state.displayed is None:
        return []
    if state.displayed != chosen:
        return [Line(f"in view: {' '.join(state.displayed)}", "NONE")]
    return [Line(f"{state.vertices:,} vertices", "NONE"), *(Line(note, "DOT") for note in state.notes)]


def left_out(state: State) -> list[Line]:
    """Heads that cannot be shown, and why: the first few."""
    lines = [Line(f"left out: {reason}", "ERROR") for reason in state.skipped[:SKIPPED_SHOWN]]
    if (more := len(state.skipped) - SKIPPED_SHOWN) > 0:
        lines.append(Line(f"and {more} more left out", "BLANK1"))
    return lines


def landmarks(state: State) -> Line | None:
    """Was a face found at this pose? None if nobody has looked yet."""
    if state.landmarks is None:
        return None
    if state.landmarks[1] is None:
        return Line("no face was found at this pose", "ERROR")
    return Line(f"{len(state.landmarks[1])} landmarks found", "CHECKMARK")


def look(state: State, head: HeadName, pose: tuple[float, ...]) -> Line | None:
    """Which look the picture shows, and whether it is that of the head and pose in view."""
    if state.look is None:
        return None
    if (state.look.head, state.look.pose) == (head, pose):
        return Line(f"seed {state.look.seed}", "CHECKMARK")
    of = ", ".join(f"{angle:g}" for angle in state.look.pose)
    return Line(f"seed {state.look.seed}, {state.look.head[0]} at {of}: show it again for this pose", "INFO")


def pose_count(values: Values) -> Line:
    """How many poses a head gets, or why the plan makes no sense. values: with absolute paths."""
    from .grid import NotDrawn, plan_poses  # numpy comes in with the first tab that is opened

    poses = section_of(values, "poses")
    try:
        count = len(plan_poses(poses, ("", "")))
    except NotDrawn:
        count = poses.count
    except HeadturnError as error:
        return Line(str(error), "ERROR")
    return Line(f"{count:,} poses a head", "INFO")


def outcome(build: Build, state: State) -> Line | None:
    """How far a build is, how it ended, or why it did not start."""
    if build.runs or build.exit_code is not None:
        return Line(build.headline(), "INFO" if build.runs or build.exit_code == 0 else "ERROR")
    return Line(state.error, "ERROR") if build.refused and state.error else None


def _parts(field: Field, values: Values) -> int:
    """Random poses have ranges without a step."""
    ranged = field.setting.section == "poses" and field.style == "numbers"
    return 2 if ranged and is_drawn(values) else 0
