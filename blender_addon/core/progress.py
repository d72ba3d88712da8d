# SPDX-License-Identifier: GPL-3.0-or-later
"""What a build's events add up to: one state, drawn by the panel and printed by headless runs."""

from __future__ import annotations

import time
from dataclasses import dataclass, field
from typing import Any

LINE_EVERY_S = 5.0
RENDERING = "rendering"

EXIT_MEANING = {
    0: "done",
    1: "failed",
    2: "wrong use",
    3: "finished, but something was left out",
    130: "stopped",
    143: "stopped",
    149: "stopped",
}


@dataclass
class Progress:
    """The state of one build. Feed it the events of ``headturn build --json``.

    rate: steps of the stage a second. rendered: images, and render_rate: how many a second.
    """

    stage: str = "starting"
    done: int = 0
    total: int = 0
    rate: float = 0.0
    eta_s: float = 0.0
    rendered: int = 0
    render_rate: float = 0.0
    notes: list[str] = field(default_factory=list)
    result: dict[str, Any] | None = None

    def take(self, event: dict[str, Any]) -> None:
        """One event; kinds we do not know are left alone, so that a newer host can say more."""
        match event.get("event"):
            case "stage":
                self.stage, self.total = event["stage"], event["total"]
                self.done, self.rate, self.eta_s = 0, 0.0, 0.0
            case "progress":
                self.stage, self.done, self.total = event["stage"], event["done"], event["total"]
                self.rate, self.eta_s = event["rate"], event["eta_s"]
                if self.stage == RENDERING:
                    self.rendered, self.render_rate = self.done, self.rate
            case "note":
                self.notes.append(event["text"])
            case "finished":
                self.result = event

    @property
    def share(self) -> float:
        """0-1 of the current stage."""
        return self.done / self.total if self.total else 0.0

    def line(self) -> str:
        """Such as "rendering 120 of 693 · 34.1/s · 0:17 left"."""
        if self.result is not None:
            return f"{self.result['rows']} images, {self.result['detection_rate']:.0%} detected"
        if not self.total:
            return self.stage
        text = f"{self.stage} {self.done} of {self.total}"
        if self.rate and self.done < self.total:
            text += f" · {self.rate:.1f}/s · {duration(self.eta_s)} left"
        return text


@dataclass
class Told:
    """What was already said of a progress, for those who read lines."""

    _notes: int = 0
    _stage: str = ""
    _at: float = 0.0

    def new(self, progress: Progress) -> list[str]:
        """Notes, and how far it is: at the start of a stage, and every few seconds."""
        lines = progress.notes[self._notes :]
        self._notes += len(lines)
        now = time.monotonic()
        if progress.total and (progress.stage != self._stage or now - self._at >= LINE_EVERY_S):
            self._stage, self._at = progress.stage, now
            lines.append(progress.line())
        return lines


def duration(seconds: float) -> str:
    """3725 -> "1:02:05"."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
