# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender executable under test."""

from __future__ import annotations

import os
import subprocess
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class RealBlender:
    """A Blender executable with the extension installed for it alone.

    windowed: the command that runs it with a window on a virtual screen.
    """

    executable: str
    windowed: tuple[str, ...]
    environment: dict[str, str]

    def run(
        self,
        *arguments: str,
        check: bool = True,
        timeout: float = 200,
        cwd: Path | None = None,
        **environment: str,
    ):
        """Run it to its end; returns what it said and its exit code."""
        return self._run([self.executable, *arguments], check, timeout, environment, cwd)

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        """Run it beside the test."""
        return subprocess.Popen(
            [self.executable, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, **self.environment},
        )

    def run_with_window(self, *arguments: str, timeout: float = 560, **environment: str):
        """The same with a window of 1280 x 720."""
        flags = ["--enable-event-simulate", "--window-geometry", "0", "0", "1280", "720"]
        return self._run([*self.windowed, *flags, *arguments], False, timeout, environment)

    def _run(
        self,
        command: list[str],
        check: bool,
        timeout: float,
        environment: dict[str, str],
        cwd: Path | None = None,
    ):
        done = subprocess.run(
            command,
            cwd=cwd,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
            env={**os.environ, **self.environment, **environment},
        )
        assert not check or done.returncode == 0, done.stdout + done.stderr
        return done
