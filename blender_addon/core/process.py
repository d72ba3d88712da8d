# SPDX-License-Identifier: GPL-3.0-or-later
"""A host process that speaks JSON lines, read by threads so that Blender never waits."""

from __future__ import annotations

import contextlib
import json
import queue
import subprocess
import threading
from collections import deque
from collections.abc import Sequence
from typing import IO, Any

from generator.errors import WorkerError
from generator.interpreter import python_environment
from generator.platforms import HERE
from generator.reading import parse_json

_LOG_LINES = 40


class HostProcess:
    """Starts a command; see :meth:`poll`.

    Its stdin and stdout are pipes to Blender: when Blender is gone, however it
    went, the host's next line finds nobody and the host ends.
    """

    def __init__(self, command: Sequence[str]) -> None:
        try:
            self._process = subprocess.Popen(
                command,
                env=python_environment(),
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                encoding="utf-8",
                errors="replace",
                **HERE.own_group(),
            )
        except OSError as error:
            raise WorkerError(f"cannot start {command[0]}: {error.strerror}") from error
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._log: deque[str] = deque(maxlen=_LOG_LINES)
        self._threads = [
            threading.Thread(target=self._read, args=(self._process.stdout, self._lines.put), daemon=True),
            threading.Thread(target=self._read, args=(self._process.stderr, self._log.append), daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    @property
    def pid(self) -> int:
        """Process id of the host."""
        return self._process.pid

    @property
    def log(self) -> list[str]:
        """The last lines it printed to stderr."""
        return [line.rstrip() for line in self._log if line.strip()]

    def send(self, message: dict[str, Any]) -> None:
        """Send one line. WorkerError if the host is gone."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(message) + "\n")
            self._process.stdin.flush()
        except (OSError, ValueError) as error:
            raise WorkerError(f"the host ended: {self.last_words()}") from error

    def poll(self) -> list[dict[str, Any]]:
        """Every JSON object that came since the last call; other lines go to the log. Never waits."""
        objects = []
        with contextlib.suppress(queue.Empty):
            while True:
                line = self._lines.get_nowait()
                try:
                    objects.append(parse_json(line))
                except ValueError:
                    self._log.append(line)
        return objects

    @property
    def exit_code(self) -> int | None:
        """Its exit code once it has ended and all it said was read; None before. Never waits."""
        if self._process.poll() is None or any(thread.is_alive() for thread in self._threads):
            return None
        return self._process.returncode if self._lines.empty() else None

    def last_words(self) -> str:
        """The last line of the log, for a message."""
        return self.log[-1] if self.log else "it printed nothing"

    def interrupt(self) -> None:
        """Ask it to end in order."""
        if self._process.poll() is None:
            HERE.interrupt(self._process)

    def close(self, timeout: float = 5.0) -> None:
        """Interrupt it, wait for its end, kill it if it does not come, close the pipes."""
        with contextlib.suppress(OSError):
            if self._process.stdin is not None:
                self._process.stdin.close()
        try:
            self._process.wait(0.2)
        except subprocess.TimeoutExpired:
            self.interrupt()
            try:
                self._process.wait(timeout)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
        for thread in self._threads:
            thread.join(1.0)

    @staticmethod
    def _read(stream: IO[str] | None, put: Any) -> None:
        assert stream is not None
        with stream:
            for line in stream:
                put(line)
