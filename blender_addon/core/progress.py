# SPDX-License-Identifier: GPL-3.0-or-later
"""What a build's events add up to: one state, drawn by the panel and printed by headless runs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

EXIT_MEANING = {
    0: "done",
    1: "failed",
    2: "wrong use",
    3: "finished, but something was left out",
    130: "stopped",
    143: "stopped",
}


@dataclass
class Progress:
    """The state of one build. Feed it the events of ``headturn build --json``."""

    stage: str = "starting"
    done: int = 0
    total: int = 0
    rate: float = 0.0
    eta_s: float = 0.0
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


def duration(seconds: float) -> str:
    """3725 -> "1:02:05"."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{rest:02}" if hours else f"{minutes}:{rest:02}"
