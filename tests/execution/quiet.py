# SPDX-License-Identifier: GPL-3.0-or-later
"""A reporter that shows nothing."""

from __future__ import annotations

import time
from typing import Any


class Quiet:
    """Remembers what was said, and when each stage began."""

    def __init__(self) -> None:
        self.notes: list[str] = []
        self.events: list[tuple[str, dict[str, Any]]] = []
        self.stages: dict[str, int] = {}
        self.began: dict[str, float] = {}
        self.on_frame = lambda: None

    def stage(self, name: str, total: int) -> None:
        """See generator.execution.status.Reporter."""
        self.stages[name] = total
        self.began[name] = time.perf_counter()

    def advance(self, steps: int = 1) -> None:
        """See generator.execution.status.Reporter."""
        self.on_frame()

    def note(self, text: str) -> None:
        """See generator.execution.status.Reporter."""
        self.notes.append(text)

    def event(self, kind: str, facts: dict[str, Any]) -> None:
        """See generator.execution.status.Reporter."""
        self.events.append((kind, facts))
