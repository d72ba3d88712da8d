# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panel knows besides the settings: what the host found, and what went wrong."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from .found import Found, Listing, Points
from .looks import Look

if TYPE_CHECKING:
    from .host import Host, HostFacts


def _one() -> Found[str]:
    return Found(kept=1)


@dataclass
class State:
    """Not saved with the file.

    checking: is the host being looked for? error: what went wrong last, "" if all is well. Found of a pose:
    landmarks. Of the plan and the look: extremes, what is said of them. Of a look: what the dice showed last;
    sheet: the file of the last sheet of looks. The last three have one picture each, and one answer.
    """

    host: Host | None = None
    facts: HostFacts | None = None
    host_error: str = ""
    checking: bool = False
    error: str = ""
    lists: Found[Listing] = field(default_factory=Found)
    landmarks: Found[Points] = field(default_factory=Found)
    extremes: Found[str] = field(default_factory=_one)
    look: Found[Look] = field(default_factory=lambda: Found(kept=1))
    sheet: Found[str] = field(default_factory=_one)

    def forget(self) -> None:
        """Nothing that was found counts any more."""
        self.__dict__.update(State().__dict__)
