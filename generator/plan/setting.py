# SPDX-License-Identifier: GPL-3.0-or-later
"""What a setting is; which there are says :mod:`generator.plan.settings`. stdlib only."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar, cast

T = TypeVar("T")


@dataclass(frozen=True)
class Choice:
    """One of the values a setting may have. label, help: for people; the label follows from the value."""

    value: str
    help: str = ""
    label: str = ""

    @property
    def name(self) -> str:
        """What people read."""
        return self.label or self.value.replace("_", " ").capitalize()


@dataclass(frozen=True)
class Info:
    """What is known of a setting besides its name, type and default.

    help       one sentence without its full stop
    unit       of the value, such as "mm"; "" for none
    low, high, above   smallest, largest, and "more than", of each number
    choices    of texts; none where everything goes
    flag       of the command line. Settings of one section that share a flag are given together, with
               commas; settings of several sections that share one all get its value. "" for none
    label      in Blender's panel; "" leaves it out of the panel
    grows      it chooses rows and does not change what is in one, so a dataset may grow along it
    content    it decides pixels or labels, and enters the name of a unit where it is not the default (what
               [heads] and [poses] decide is in the head's files, its placement and the poses)
    path       of a file or folder; a relative one counts from the configuration file
    varies     it may be a distribution, of which each image or each head draws; see
               :mod:`generator.plan.distribution`. Of numbers and texts in the sections of a view; of so
               many numbers, each may be one
    since      schema version of the column ``look_...`` that holds what was drawn
    """

    help: str
    unit: str = ""
    low: float | None = None
    high: float | None = None
    above: float | None = None
    choices: tuple[Choice, ...] | Callable[[], tuple[Choice, ...]] = ()
    flag: str | None = None
    label: str = ""
    grows: bool = False
    content: bool = True
    path: bool = False
    varies: bool = False
    since: str = "1.2.0"


def setting(default: T, help: str, **info: Any) -> T:
    """A field of a section. info: see :class:`Info`."""
    return cast(T, field(default=default, metadata={"info": Info(help, **info)}))


@dataclass(frozen=True)
class Setting:
    """One setting as others see it. kind: its type, such as ``float`` or ``tuple[str, ...]``."""

    section: str
    key: str
    kind: Any
    default: Any
    info: Info

    @property
    def name(self) -> str:
        """Such as "render.lens_mm"."""
        return f"{self.section}.{self.key}"

    @property
    def choices(self) -> tuple[Choice, ...]:
        """The values it may have; none where everything goes."""
        found = self.info.choices
        return found() if callable(found) else found

    @property
    def flag(self) -> str:
        """Its option of the command line, "" if it has none: the key without its unit."""
        if self.info.flag is not None:
            return self.info.flag
        return "--" + self.key.removesuffix("_mm").removesuffix("_deg").replace("_", "-")
