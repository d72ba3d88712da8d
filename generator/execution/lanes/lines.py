# SPDX-License-Identifier: GPL-3.0-or-later
"""A child process that takes and gives one JSON object a line."""

from __future__ import annotations

import contextlib
import json
import queue
import subprocess
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from generator.errors import WorkerError
from generator.interpreter import python_environment
from generator.messages import from_json
from generator.platforms import HERE

LOG_TAIL_LINES = 3
"""Lines of the child's log that go into the one line of an error."""

LOG_END_LINES = 20
"""Lines that are kept with a unit that is given up."""

ENDING_S = 5.0
"""How long a child that closed its output may take to end."""


class LineProcess:
    """Starts command, keeps what it prints to stderr in log, ends it when closed.

    A child whose stdin closes must end by itself: that is what keeps a crashed
    parent from leaving orphans. See also :func:`generator.process.end_with_parent`.
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
                    env={**python_environment(), **(env or {})},
                    text=True,
                    encoding="utf-8",
                    **HERE.own_group(),  # the host ends its children in order
                )
        except OSError as error:
            raise WorkerError(f"cannot start {command[0]}: {error.strerror}") from error
        # A pipe cannot be waited on with a deadline everywhere; a queue can.
        self._lines: queue.SimpleQueue[str] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

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

    def receive(self, deadline_s: float | None = None) -> dict[str, Any]:
        """Wait for one receipt.

        Raises WorkerError with the end of the log if the child is gone, or if it
        says nothing for deadline_s; then it is ended.
        """
        try:
            line = self._lines.get(timeout=deadline_s)
        except queue.Empty:
            self.kill()
            raise self._error(
                f"{self._name} hung: no sign of life for {deadline_s:.0f} s, so it was ended"
            ) from None
        if not line.endswith("\n"):
            raise self._ended()
        try:
            return json.loads(line)
        except json.JSONDecodeError as error:
            raise self._error(
                f"{self._name} answered with something that is not JSON: {line[:80]!r}"
            ) from error

    def receive_message(self, deadline_s: float | None = None) -> Any:
        """:meth:`receive` of one of :mod:`generator.messages`. WorkerError also if it is none."""
        values = self.receive(deadline_s)
        try:
            return from_json(values)
        except (ValueError, TypeError) as error:
            said = f"{self._name} answered with what is no message ({error}): {str(values)[:80]!r}"
            raise self._error(said) from error

    def close(self, timeout: float = ENDING_S) -> None:
        """Close the child's stdin, wait for its end, kill it if it does not come."""
        self._close_stdin()
        try:
            self._process.wait(timeout)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join(timeout)

    def kill(self) -> None:
        """End the child at once."""
        self._process.kill()
        self._process.wait()
        self._close_stdin()
        self._reader.join(1.0)

    def _read(self) -> None:
        assert self._process.stdout is not None
        with self._process.stdout as stream:
            for line in stream:
                self._lines.put(line)
        self._lines.put("")

    def _close_stdin(self) -> None:
        # The child may have gone first, with an order of ours still in the pipe.
        with contextlib.suppress(BrokenPipeError):
            if self._process.stdin is not None:
                self._process.stdin.close()

    def _ended(self) -> WorkerError:
        self._lines.put("")  # whoever asks again gets the same answer
        try:
            code = self._process.wait(ENDING_S)
        except subprocess.TimeoutExpired:
            self.kill()
            return self._error(f"{self._name} closed its output and did not end, so it was ended")
        how = f"was killed by signal {-code}" if code < 0 else f"ended with exit code {code}"
        said = " | ".join(self._log_end()[-LOG_TAIL_LINES:])
        return self._error(f"{self._name} {how}: {said or 'it printed nothing'}")

    def _error(self, message: str) -> WorkerError:
        return WorkerError(message, "\n".join(self._log_end()))

    def _log_end(self) -> list[str]:
        if not self.log.exists():
            return []
        with self.log.open("rb") as file:
            file.seek(max(0, self.log.stat().st_size - 2**14))
            text = file.read().decode("utf-8", errors="replace")
        return [line.strip() for line in text.splitlines() if line.strip()][-LOG_END_LINES:]
