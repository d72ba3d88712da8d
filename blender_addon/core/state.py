# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel knows besides the settings: heads that were found, the one in view, what went wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from .looks import Look

if TYPE_CHECKING:
    from .host import Host, HostFacts

NEUTRAL = "neutral"
HeadName = tuple[str, str]
"""(subject, expression)."""


@dataclass
class State:
    """Not saved with the file.

    displayed: the head in view. landmarks: at which pose, and the 468 points in pixels, None if no face
    was found. look: what the dice showed last. checking: is the host being looked for? error: what went
    wrong last, "" if all is well.
    """

    host: Host | None = None
    facts: HostFacts | None = None
    host_error: str = ""
    checking: bool = False
    error: str = ""
    kind: str = ""
    heads: list[HeadName] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    vertices: int = 0
    displayed: HeadName | None = None
    extremes: str = ""
    landmarks: tuple[tuple[float, ...], list[list[float]] | None] | None = None
    look: Look | None = None

    def subjects(self) -> list[str]:
        """Subjects in the source's order."""
        return list(dict.fromkeys(subject for subject, _ in self.heads))

    def expressions(self, subject: str) -> list[str]:
        """Expressions of a subject."""
        return [expression for name, expression in self.heads if name == subject]

    def first_of(self, subject: str) -> str:
        """The expression that a subject is first shown with: neutral if it has that."""
        there = self.expressions(subject)
        return NEUTRAL if NEUTRAL in there else there[0]

    def beside(self, head: HeadName, what: str, by: int) -> HeadName:
        """The head that is by steps further, around the end. what: "SUBJECT" or "EXPRESSION"."""
        subject, expression = head
        if what == "SUBJECT":
            subject = _after(self.subjects(), subject, by)
            return subject, self.first_of(subject)
        return subject, _after(self.expressions(subject), expression, by)

    def take_list(self, answer: dict[str, Any]) -> None:
        """What a source holds, as the host listed it. Nothing of an earlier one is in view any more."""
        self.displayed = None
        self.kind, self.skipped = answer["kind"], answer["skipped"]
        self.heads = [(head["subject"], head["expression"]) for head in answer["heads"]]
        if not self.heads:
            self.error = self.skipped[0] if self.skipped else "this source holds no heads"

    def take_head(self, head: HeadName, answer: dict[str, Any]) -> None:
        """A head came into view, as the host placed it."""
        self.notes, self.vertices, self.displayed = answer["notes"], answer["vertices"], head

    def take_extremes(self, found: Sequence[object]) -> None:
        """What was found at the outermost poses; None where no face was."""
        there = sum(points is not None for points in found)
        self.extremes = f"A face was found in {there} of {len(found)}"

    def forget_heads(self) -> None:
        """The source changed: what was found no longer counts."""
        self.heads, self.skipped, self.error = [], [], ""

    def forget(self) -> None:
        """Nothing that was found counts any more."""
        self.__dict__.update(State().__dict__)


def _after(names: list[str], name: str, by: int) -> str:
    return names[(names.index(name) + by) % len(names)] if name in names else names[0]
