# SPDX-License-Identifier: GPL-3.0-or-later
"""One build of the host: how far it is, how it ended, what to say of it."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from generator.escape import printable

from .progress import EXIT_MEANING, Progress

LOOK_EVERY_S = 2.0


class Process(Protocol):
    """The host at work, see :class:`blender_addon.core.process.HostProcess`."""

    @property
    def pid(self) -> int:
        """Process id."""
        ...

    @property
    def log(self) -> list[str]:
        """The last lines that were no events."""
        ...

    @property
    def exit_code(self) -> int | None:
        """None while it runs."""
        ...

    def poll(self) -> list[dict[str, Any]]:
        """The events that came since the last call."""
        ...

    def interrupt(self) -> None:
        """Ask it to end in order."""
        ...

    def close(self) -> None:
        """End it."""
        ...


@dataclass
class Build:
    """The build that runs, or ran last. It belongs to this Blender, not to the file that is open.

    starting: the host is looked for. refused: why it did not even start. newest: the image that was written
    last. report: what it came to, as a text of some lines; "" before it has ended.
    """

    out: Path | None = None
    starting: bool = False
    process: Process | None = None
    progress: Progress = field(default_factory=Progress)
    exit_code: int | None = None
    cancelled: bool = False
    refused: str = ""
    newest: Path | None = None
    report: str = ""
    _last_line: str = ""
    _looked: float = field(default=0.0, repr=False)

    @property
    def runs(self) -> bool:
        """Was it asked for, and has not ended?"""
        return self.starting or self.process is not None

    def expect(self, out: Path) -> None:
        """A process that builds into the folder out will be there once there is a host."""
        self.forget()
        self.starting, self.out = True, out

    def start(self, process: Process, out: Path) -> None:
        """Follow a process that builds into the folder out."""
        self.forget()
        self.process, self.out = process, out

    def refuse(self, reason: str) -> None:
        """It cannot start."""
        self.starting, self.refused = False, reason

    def forget(self) -> None:
        """What the last build came to no longer counts."""
        self.starting, self.exit_code, self.cancelled, self.refused = False, None, False, ""
        self.progress, self.newest, self.report, self._last_line = Progress(), None, "", ""

    def cancel(self) -> None:
        """Ask the host to end; what is finished stays, and building again continues."""
        self.cancelled = self.runs
        self.starting = False
        if self.process is not None:
            self.process.interrupt()

    def poll(self) -> bool:
        """Take in what the host said. True if anything changed."""
        if self.process is None:
            return False
        events = self.process.poll()
        for event in events:
            self.progress.take(event)
        if time.monotonic() - self._looked > LOOK_EVERY_S:
            self._looked = time.monotonic()
            self._look_at_images()
        code = self.process.exit_code
        if code is not None:
            self._finish(code, self.process)
        return bool(events) or code is not None

    def close(self) -> None:
        """End it, because Blender ends or the extension is disabled."""
        self.starting = False
        if self.process is not None:
            self.process.close()
            self.process = None

    def headline(self) -> str:
        """One line for the panel."""
        if self.runs:
            return "stopping..." if self.cancelled else self.progress.line()
        if self.cancelled:
            return "stopped: Build continues where it ended"
        return f"{self._meaning(f'ended with exit code {self.exit_code}')}: {self._outcome()}"

    def _meaning(self, other: str) -> str:
        return other if self.exit_code is None else EXIT_MEANING.get(self.exit_code, other)

    def _outcome(self) -> str:
        return self.progress.line() if self.exit_code in (0, 3) else self._last_line

    def _finish(self, code: int, process: Process) -> None:
        self.exit_code = code
        log = process.log
        self._last_line = log[-1].removeprefix("headturn: ") if log else "the host printed nothing"
        self._look_at_images()
        meaning = "stopped" if self.cancelled else self._meaning("ended")
        self.report = f"{self.out}\n{meaning} (exit code {code}): {printable(self._outcome())}\n\n"
        for title, lines in (("Notes", self.progress.notes), ("Log", log)):
            if lines:
                self.report += f"{title}\n" + "".join(f"  {printable(line)}\n" for line in lines) + "\n"
        self.close()

    def _look_at_images(self) -> None:
        if self.out is not None:
            self.newest = newest_image(self.out / "images") or self.newest


def newest_image(folder: Path) -> Path | None:
    """The newest image of a dataset: of its newest folder, so that no big tree is walked."""
    while folder.is_dir():
        with os.scandir(folder) as entries:
            # What has a dot in front is still being written.
            there = [e for e in entries if not e.name.startswith(".")]
        if not there:
            return None
        newest = max(there, key=lambda entry: entry.stat().st_mtime_ns)
        if newest.is_file():
            return Path(newest.path)
        folder = Path(newest.path)
    return None
