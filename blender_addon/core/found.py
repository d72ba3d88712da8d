# SPDX-License-Identifier: GPL-3.0-or-later
"""What the host found, each with the key of what it was asked about: it counts where that key does."""

from __future__ import annotations

import json
from collections.abc import Hashable, Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any, Generic, TypeVar

T = TypeVar("T")

NEUTRAL = "neutral"
HeadName = tuple[str, str]
"""(subject, expression)."""


class Found(Generic[T]):
    """Answers by their keys. kept: so many of the newest."""

    def __init__(self, kept: int = 8) -> None:
        self._kept = kept
        self._values: dict[Hashable, T] = {}

    def take(self, key: Hashable, value: T) -> None:
        """The newest answer."""
        self._values.pop(key, None)
        self._values[key] = value
        while len(self._values) > self._kept:
            del self._values[next(iter(self._values))]

    def of(self, key: Hashable) -> T | None:
        """What was found, None if nobody has looked."""
        return self._values.get(key)


@dataclass(frozen=True)
class Listing:
    """The heads of a source. skipped: why some were left out."""

    heads: list[HeadName] = field(default_factory=list)
    skipped: list[str] = field(default_factory=list)

    @staticmethod
    def of(answer: dict[str, Any]) -> Listing:
        """As the host listed them."""
        return Listing([(head["subject"], head["expression"]) for head in answer["heads"]], answer["skipped"])

    def text(self, source: str) -> str:
        """For a property, so that files take it along; see :meth:`read`. source: key of the source."""
        return json.dumps({"source": source, **asdict(self)})

    @staticmethod
    def read(text: str, source: str) -> Listing | None:
        """None if nothing was listed, or of another source."""
        key, listed = _listed(text)
        return listed if key == source else None

    @property
    def problem(self) -> str:
        """Why there is nothing to show; "" if there is."""
        return "" if self.heads else next(iter(self.skipped), "this source holds no heads")

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


NOTHING = Listing()


@lru_cache(maxsize=4)
def _listed(text: str) -> tuple[str, Listing | None]:
    """The panel asks at every drawing, and a source may hold thousands."""
    if not text:
        return "", None
    told = json.loads(text)
    return told["source"], Listing([(subject, name) for subject, name in told["heads"]], told["skipped"])


@dataclass(frozen=True)
class Placed:
    """The head in view, as the host placed it. Kept in the scene, so that undo and files take it along.

    source: key of the source it is of. vertices: of its mesh. notes: what is to be said of it.
    """

    head: HeadName
    source: str
    vertices: int
    notes: list[str] = field(default_factory=list)

    def text(self) -> str:
        """For a property; see :meth:`read`."""
        return json.dumps(asdict(self))

    @staticmethod
    def read(text: str) -> Placed | None:
        """None if no head was placed."""
        if not text:
            return None
        told = json.loads(text)
        return Placed(tuple(told["head"]), told["source"], told["vertices"], told["notes"])


@dataclass(frozen=True)
class Points:
    """468 landmarks in pixels; None if no face was found."""

    points: list[list[float]] | None


def extremes(found: Sequence[object]) -> str:
    """What was found at the outermost poses; None where no face was."""
    there = sum(points is not None for points in found)
    return f"A face was found in {there} of {len(found)}"


def _after(names: list[str], name: str, by: int) -> str:
    return names[(names.index(name) + by) % len(names)] if name in names else names[0]
