# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender says otherwise than the table of settings, whose words are those of the command line."""

from __future__ import annotations

from typing import NamedTuple


class Unset(NamedTuple):
    """The switch that leaves a number out: its name and tooltip. start: the number when it is first given."""

    name: str
    help: str
    start: float


WHERE_NOT_GIVEN = "Leave it to Headturn"

UNSET = {
    "render.distance_mm": Unset(
        "Frame Each Head", "The camera stands where the head just fits at every pose", 700.0
    ),
    "render.samples": Unset("Samples of the Look", "As many samples a pixel as the look needs", 16),
}
"""By setting; others are named after it."""

GUESSED = ("Guess", "Found when the heads are read")
"""Name and tooltip of a choice that is not given."""

NOT_GIVEN = {
    "heads.redistributable": ("As They Say", "As the heads' own cards say; not, where they do not say")
}
"""The same by setting, where it is not guessed."""

LIMITS = {"poses.yaw": 89.9, "poses.pitch": 180.0, "poses.roll": 180.0}
"""Degrees to either side; generator.plan.poses refuses what is beyond."""

_RANGE = "From, to and step. Random plans use from and to"

LABELS = {"heads.source:ict": "ICT-FaceKit", "dataset.passes:uv": "UV"}
"""Of choices whose name is no word."""

HELP = {
    "heads.source:parametric": "Heads made on the spot from MakeHuman's CC0 data",
    "heads.source:ict": "Heads made on the spot from your own copy of ICT-FaceKit, in the folder",
    "heads.source:FOLDER": "A FaceScape download, a folder of OBJ, PLY, GLB, FBX, DAE, USD, or of subjects",
    "heads.source": "Where the heads come from",
    "heads.seed": "The same seed makes the same heads",
    "heads.subjects": "Only these, separated by commas. Empty: all of them",
    "heads.expressions": "Only these, separated by commas, such as neutral, smile. Empty: all of them",
    "heads.license": "Of heads that do not say, such as CC-BY-4.0. Empty: as they say",
    "poses.kind": "How the poses are chosen",
    "poses.yaw": _RANGE,
    "poses.pitch": _RANGE,
    "poses.roll": _RANGE,
    "poses.seed": "Of random poses",
    "dataset.passes": "Further images of each view, in OpenEXR: what each pixel shows",
    "render.background": "Colour behind the head",
}
"""Tooltips by setting, where the command line's help speaks of its options or of how a value is written."""

_SMALL = {"a", "an", "and", "as", "at", "for", "in", "of", "or", "the", "to"}


def titled(label: str) -> str:
    """A label as Blender writes them: "Pose zero" -> "Pose Zero"; capitals stay."""
    words = label.split(" ")
    return " ".join(w if k and w in _SMALL else w[:1].upper() + w[1:] for k, w in enumerate(words))
