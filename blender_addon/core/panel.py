# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel shows: which settings, in which rows, and the lines between them."""

from __future__ import annotations

from dataclasses import dataclass
from dataclasses import fields as fields_of
from typing import NamedTuple

from generator.errors import HeadturnError
from generator.plan.render_settings import Sensor
from generator.plan.settings import SECTIONS, Values
from generator.plan.shading import Shading
from generator.plan.wear import Wear

from .build import Build
from .conversation import Conversation
from .field import Field
from .fields import fields
from .found import HeadName, Listing, Placed, Points
from .looks import Look
from .tables import applies, is_drawn, is_gridded, section_of
from .words import LIMITS

SKIPPED_SHOWN = 3

SELECTION, SENSOR, LAMPS, WORN = "Selection", "Sensor", "Lamps and Skin", "Worn"
"""Panels below those of their sections, which are closed at first."""

_BELOW = {
    **dict.fromkeys(
        (
            *("heads.subjects", "heads.expressions", "heads.license", "heads.redistributable"),
            *("heads.units", "heads.eye_distance_mm", "heads.up", "heads.forward"),
        ),
        SELECTION,
    ),
    **{
        f"render.{one.name}": place
        for place, those in ((SENSOR, Sensor), (LAMPS, Shading), (WORN, Wear))
        for one in fields_of(those)
    },
}
"""Setting -> the panel below that it stands in. All others stand in the panel of their section."""

COLUMNS = ("From", "To", "Step")
"""Above the ranges of angles."""

OWN_PANEL = ("heads", "poses", "render")
"""Sections with a panel of their own; those of all others stand beside the Build button."""


class Line(NamedTuple):
    """A line of text. icon: a name of Blender's, "NONE" for none."""

    text: str
    icon: str


@dataclass(frozen=True)
class Row:
    """A setting in the panel. parts: how many of its numbers stand in columns; 0 where there are none.

    header: over its columns; () below a row that has it.
    """

    field: Field
    parts: int = 0
    header: tuple[str, ...] = ()


def rows(sections: tuple[str, ...], values: Values, below: str = "") -> list[Row]:
    """The rows of some sections, in the table's order: the settings that mean something beside these values.

    below: those of this panel below theirs; without it, those of none.
    """
    found: list[Row] = []
    for field in fields():
        setting = field.setting
        if setting.section in sections and applies(field, values) and _BELOW.get(setting.name, "") == below:
            parts = _parts(field, values)
            begins = parts and not (found and found[-1].parts == parts)
            found.append(Row(field, parts, COLUMNS[:parts] if begins else ()))
    return found


def other_sections() -> tuple[str, ...]:
    """Sections that have no panel of their own."""
    return tuple(name for name in SECTIONS if name not in OWN_PANEL)


def going_on(conversation: Conversation) -> Line | None:
    """What went wrong last, or what is going on."""
    if conversation.state.error:
        return Line(conversation.state.error, "ERROR")
    return Line(conversation.busy, "SORTTIME") if conversation.busy else None


def found(listing: Listing) -> Line:
    """How many heads there are."""
    return Line(f"{len(listing.heads)} heads of {len(listing.subjects())} subjects", "INFO")


def in_view(placed: Placed | None, chosen: HeadName, source: str) -> list[Line]:
    """Of the head in view: its vertices and what is to be said of it, or its name if another is chosen.

    source: the key of the one that is named; the head in view may be of another.
    """
    if placed is None:
        return []
    name = " ".join(placed.head)
    if placed.source != source:
        return [Line(f"in view: {name}, of other heads than those named above; load them", "INFO")]
    if placed.head != chosen:
        return [Line(f"in view: {name}", "NONE")]
    return [Line(f"{placed.vertices:,} vertices", "NONE"), *(Line(note, "DOT") for note in placed.notes)]


def left_out(listing: Listing) -> list[Line]:
    """Heads that cannot be shown, and why: the first few."""
    lines = [Line(f"left out: {reason}", "ERROR") for reason in listing.skipped[:SKIPPED_SHOWN]]
    if (more := len(listing.skipped) - SKIPPED_SHOWN) > 0:
        lines.append(Line(f"and {more} more left out", "BLANK1"))
    return lines


def landmarks(found: Points | None) -> Line | None:
    """Was a face found at this pose? None if nobody has looked yet."""
    if found is None:
        return None
    if found.points is None:
        return Line("no face was found at this pose", "ERROR")
    return Line(f"{len(found.points)} landmarks found", "CHECKMARK")


def look(shown: Look, pose: tuple[float, ...]) -> Line:
    """Which look the picture shows, and whether it is that of the pose in view."""
    if shown.pose == pose:
        return Line(f"seed {shown.seed}", "CHECKMARK")
    of = ", ".join(f"{angle:g}" for angle in shown.pose)
    return Line(f"seed {shown.seed}, {shown.head[0]} at {of}: show it again for this pose", "INFO")


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


def snap(values: Values) -> Line | None:
    """What snapping needs where it does nothing."""
    if is_gridded(values):
        return None
    return Line("Snap needs Dataset Poses: Grid", "INFO")


def outcome(build: Build) -> Line | None:
    """How far a build is, how it ended, or why it did not start."""
    if build.runs or build.exit_code is not None:
        return Line(build.headline(), "INFO" if build.runs or build.exit_code == 0 else "ERROR")
    return Line(build.refused, "ERROR") if build.refused else None


def _parts(field: Field, values: Values) -> int:
    """Random poses have ranges without a step."""
    ranged = field.setting.name in LIMITS
    return (2 if is_drawn(values) else 3) if ranged else 0
