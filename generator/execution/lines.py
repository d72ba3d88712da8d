# SPDX-License-Identifier: GPL-3.0-or-later
"""A child process that takes and gives one JSON object a line."""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from generator.errors import WorkerError

LOG_TAIL_LINES = 3


class LineProcess:
    """Starts command, keeps what it prints to stderr in log, ends it when closed.

    A child whose stdin closes must end by itself: that is what keeps a crashed
    parent from leaving orphans.
    """

    def __init__(self, command: Sequence[str], log: Path, env: dict[str, str] | None = None) -> None:
        self.log = log
        self._name = Path(command[0]).name
        try:
            with log.open("ab") as stream:
                self._process = subprocess.Popen(
                    command,
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=stream,
                    env={**os.environ, **(env or {})},
                    text=True,
                    encoding="utf-8",
                    # Ctrl-C is for the host alone, which then ends its children in order.
                    start_new_session=True,
                )
        except OSError as error:
            raise WorkerError(f"cannot start {command[0]}: {error.strerror}") from error

    @property
    def pid(self) -> int:
        """Process id of the child."""
        return self._process.pid

    def send(self, message: dict[str, Any]) -> None:
        """Send one order. WorkerError if the child is gone."""
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(message) + "\n")
            self._process.stdin.flush()
        except (BrokenPipeError, ValueError) as error:
            raise self._ended() from error

    def receive(self) -> dict[str, Any]:
        """Wait for one receipt. WorkerError with the end of the log if the child is gone."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line.endswith("\n"):
            raise self._ended()
        try:
            return json.loads(line)
        except json.JSONDecodeError as error:
            raise WorkerError(
                f"{self._name} answered with something that is not JSON: {line[:80]!r}"
            ) from error

    def close(self, timeout: float = 5.0) -> None:
        """Close the child's stdin, wait for its end, kill it if it does not come."""
        self._close_pipes()
        try:
            self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            self.kill()

    def kill(self) -> None:
        """End the child at once."""
        self._process.kill()
        self._process.wait()
        self._close_pipes()

    def _close_pipes(self) -> None:
        for stream in (self._process.stdin, self._process.stdout):
            # The child may have gone first, with an order of ours still in the pipe.
            with contextlib.suppress(BrokenPipeError):
                if stream is not None:
                    stream.close()

    def _ended(self) -> WorkerError:
        code = self._process.wait()
        text = self.log.read_text(encoding="utf-8", errors="replace") if self.log.exists() else ""
        tail = " | ".join(line.strip() for line in text.splitlines()[-LOG_TAIL_LINES:] if line.strip())
        how = f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
        return WorkerError(f"{self._name} {how}: {tail or 'it printed nothing'}")
