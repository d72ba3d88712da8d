# SPDX-License-Identifier: GPL-3.0-or-later
"""How a build says what it is doing, and the log it leaves behind."""

from __future__ import annotations

import contextlib
import json
import threading
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, Protocol, TextIO

from generator.dataset.format.build_files import LOG_FILE
from generator.escape import printable


class Progress(Protocol):
    """Where a piece of work says how far it is."""

    def stage(self, name: str, total: int) -> None:
        """A stage begins; total steps follow."""

    def advance(self, steps: int = 1) -> None:
        """Steps of the current stage are done. May be called from any thread."""


class Reporter(Progress, Protocol):
    """Where a build says what it is doing."""

    def note(self, text: str) -> None:
        """One line that should be read."""

    def event(self, kind: str, facts: dict[str, Any]) -> None:
        """Something happened that is counted: "unit" (one was committed) or "quarantined" (given up).

        facts: plain values for JSON; both have "attempts", "unit" has "seconds" a stage.
        """


class LoggingReporter:
    """Passes everything on to another reporter, and writes all but the steps to build.log."""

    def __init__(self, reporter: Reporter, root: Path) -> None:
        self._reporter, self._path = reporter, root / LOG_FILE
        self._lock = threading.Lock()
        self._file: TextIO | None = None

    def __enter__(self) -> LoggingReporter:
        self._file = self._path.open("a", encoding="utf-8", buffering=1)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        if error is not None:
            self._write(f"stopped: {type(error).__name__}: {error}")
        if self._file is not None:
            with contextlib.suppress(OSError):
                self._file.close()

    def log(self, text: str) -> None:
        """A line for the log alone."""
        self._write(text)

    def stage(self, name: str, total: int) -> None:
        """See :class:`Reporter`."""
        self._write(f"{name}: {total}")
        self._reporter.stage(name, total)

    def advance(self, steps: int = 1) -> None:
        """See :class:`Reporter`."""
        self._reporter.advance(steps)

    def note(self, text: str) -> None:
        """See :class:`Reporter`."""
        self._write(text)
        self._reporter.note(text)

    def event(self, kind: str, facts: dict[str, Any]) -> None:
        """See :class:`Reporter`."""
        self._write(f"{kind} {json.dumps(facts)}")
        self._reporter.event(kind, facts)

    def _write(self, text: str) -> None:
        assert self._file is not None, "use it in a with statement"
        # A full disk is told by whoever writes what matters.
        with self._lock, contextlib.suppress(OSError):
            self._file.write(f"{datetime.now(timezone.utc):%Y-%m-%dT%H:%M:%SZ} {printable(text)}\n")
