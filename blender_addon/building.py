# SPDX-License-Identifier: GPL-3.0-or-later
"""One build of the host, seen from Blender."""

from __future__ import annotations

import os
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from . import pictures, session

if TYPE_CHECKING:
    from .core.process import HostProcess
    from .core.progress import Progress

REPORT = "Headturn report"
LAST_IMAGE = "build/last"
_LOOK_EVERY_S = 2.0


@dataclass
class Build:
    """The build that runs, or ran last. Shown by the panel; not saved with the file."""

    out: Path | None = None
    process: HostProcess | None = None
    progress: Progress | None = None
    exit_code: int | None = None
    cancelled: bool = False
    refused: bool = False
    last_line: str = ""
    _looked: float = field(default=0.0, repr=False)

    @property
    def runs(self) -> bool:
        """Has it started and not ended?"""
        return self.process is not None

    def start(self, scene: bpy.types.Scene) -> None:
        """Start the host on the scene's configuration. Raises HeadturnError."""
        from . import settings
        from .core.host import host_command
        from .core.process import HostProcess
        from .core.progress import Progress

        shown = scene.headturn
        self.out = Path(bpy.path.abspath(shown.out)).absolute()
        folder = Path(bpy.app.tempdir or tempfile.gettempdir())
        configuration = folder / "headturn-build.toml"
        settings.save(shown, configuration)
        arguments = ["build", str(configuration), "--out", str(self.out), "--json"]
        if shown.workers:
            arguments += ["--workers", str(shown.workers)]
        command = host_command(session.state.host, session.state.facts, arguments, bpy.app.binary_path)
        self.process = HostProcess(command)
        self.progress = Progress()
        self.exit_code, self.cancelled, self.last_line = None, False, ""

    def forget(self) -> None:
        """What the last build came to no longer counts."""
        self.exit_code, self.cancelled, self.refused, self.progress = None, False, False, None
        pictures.forget(LAST_IMAGE)

    def cancel(self) -> None:
        """Ask the host to end; what is finished stays, and building again continues."""
        if self.process is not None:
            self.cancelled = True
            self.process.interrupt()

    def poll(self) -> bool:
        """Take in what the host said. True if anything changed."""
        if self.process is None or self.progress is None:
            return False
        events = self.process.poll()
        for event in events:
            self.progress.take(event)
        if time.monotonic() - self._looked > _LOOK_EVERY_S:
            self._looked = time.monotonic()
            self._look_at_images()
        code = self.process.exit_code
        if code is not None:
            self._finish(code)
        return bool(events) or code is not None

    def close(self) -> None:
        """End it, because Blender ends or the extension is disabled."""
        if self.process is not None:
            self.process.close()
            self.process = None

    def headline(self) -> str:
        """One line for the panel."""
        from .core.progress import EXIT_MEANING

        if self.runs:
            return "stopping..." if self.cancelled else self.progress.line()
        if self.cancelled:
            return "stopped: Build continues where it ended"
        meaning = EXIT_MEANING.get(self.exit_code, f"ended with exit code {self.exit_code}")
        return f"{meaning}: {self._outcome()}"

    def _outcome(self) -> str:
        return self.progress.line() if self.exit_code in (0, 3) else self.last_line

    def _finish(self, code: int) -> None:
        self.exit_code = code
        log = self.process.log
        self.last_line = log[-1].removeprefix("headturn: ") if log else "the host printed nothing"
        self._look_at_images()
        self._report(log)
        self.close()

    def _report(self, log: list[str]) -> None:
        text = bpy.data.texts.get(REPORT) or bpy.data.texts.new(REPORT)
        text.clear()
        notes = self.progress.notes
        text.write(f"{self.out}\n{self.headline_of_report()}\n\n")
        for title, lines in (("Notes", notes), ("Log", log)):
            if lines:
                text.write(f"{title}\n" + "".join(f"  {line}\n" for line in lines) + "\n")

    def headline_of_report(self) -> str:
        """What came of it, with the exit code."""
        from .core.progress import EXIT_MEANING

        meaning = "stopped" if self.cancelled else EXIT_MEANING.get(self.exit_code, "ended")
        return f"{meaning} (exit code {self.exit_code}): {self._outcome()}"

    def _look_at_images(self) -> None:
        newest = _newest(self.out / "images") if self.out is not None else None
        if newest is not None:
            pictures.keep(LAST_IMAGE, newest)


current = Build()


def _newest(folder: Path) -> Path | None:
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
