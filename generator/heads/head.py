# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head source knows about a head before anything is loaded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

NEUTRAL = "neutral"


@dataclass(frozen=True)
class Head:
    """One expression of one subject, on disk.

    subject, expression: identity as strings, never a path; expression is
        "neutral" where the source has only one mesh a subject.
    source: "parametric", "facescape" or "mesh".
    mesh_path: the mesh file. files: every file that decides the result,
        mesh first, then materials and textures.
    license: SPDX id or the source's own words; "unknown" if it says nothing.
    redistributable: may rendered images be published?
    units: "mm", "cm", "dm" or "m"; None means guess from the size of the face.
    up, forward: axes of the mesh such as "+Y" and "+Z"; None means guess.
    problems: what is wrong but does not stop the head from being built.
    """

    subject: str
    expression: str
    source: str
    mesh_path: Path
    files: tuple[Path, ...]
    license: str = "unknown"
    redistributable: bool = False
    attribution: str = ""
    units: str | None = None
    up: str | None = None
    forward: str | None = None
    problems: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """subject/expression, for messages."""
        return f"{self.subject}/{self.expression}"


@dataclass(frozen=True)
class SkippedHead:
    """A head the source names but cannot give, and why."""

    subject: str
    expression: str
    path: Path
    reason: str


@dataclass(frozen=True)
class HeadSource:
    """Everything found under one path."""

    path: Path
    kind: str
    heads: tuple[Head, ...]
    skipped: tuple[SkippedHead, ...] = ()
