# SPDX-License-Identifier: GPL-3.0-or-later
"""Ctrl-C, being told to end, and a terminal that is closed: one exception, and time to clean up."""

from __future__ import annotations

import errno
import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import FrameType
from typing import Any

from generator.platforms import HERE

SIGNALS = [getattr(signal, name) for name in HERE.ending if hasattr(signal, name)]

AGAIN_S = 0.02
PATIENCE = 500
"""Signals in the middle of an import wait for its end, looked for so often, and so many times at most."""


class Stopped(BaseException):
    """A signal ended the work. exit_code: as shells count it, 128 + the signal."""

    def __init__(self, number: int) -> None:
        super().__init__(f"stopped by {signal.Signals(number).name}")
        self.exit_code = 128 + number


@contextmanager
def stoppable() -> Iterator[None]:
    """Raise Stopped in the main thread at the first signal; later ones do not disturb the cleaning up.

    A signal that is ignored already stays so: under nohup a build outlives its terminal. Libraries take an
    exception in the middle of their import for a reason to do without something, and go on: there the
    signal waits. Must be entered in the main thread.
    """
    terminals = [number for number in (0, 1, 2) if _is_terminal(number)]
    waiting: list[int] = []

    def stop(number: int, frame: FrameType | None) -> None:
        if hasattr(signal, "setitimer") and _imports(frame) and len(waiting) < PATIENCE:
            waiting.append(number)
            before.setdefault(signal.SIGALRM, signal.getsignal(signal.SIGALRM))
            signal.signal(signal.SIGALRM, lambda _, now: stop(number, now))
            signal.setitimer(signal.ITIMER_REAL, AGAIN_S)
            return
        waiting.clear()
        for other in SIGNALS:
            signal.signal(other, signal.SIG_IGN)
        _leave(terminals)
        raise Stopped(number)

    heeded = [number for number in SIGNALS if signal.getsignal(number) is not signal.SIG_IGN]
    before: dict[int, Any] = {number: signal.signal(number, stop) for number in heeded}
    try:
        yield
        if waiting:
            raise Stopped(waiting[0])
    except OSError as error:
        # What is written to a terminal that was closed fails, perhaps before the signal is heard of.
        if error.errno == errno.EIO and _leave(terminals):
            raise Stopped(signal.SIGHUP) from error
        raise
    finally:
        if waiting:
            signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in before.items():
            signal.signal(number, handler)


def _imports(frame: FrameType | None) -> bool:
    """Is a module being imported here, or something taken apart, where exceptions get lost?"""
    while frame is not None:
        if frame.f_code.co_filename.startswith("<frozen importlib") or frame.f_code.co_name == "__del__":
            return True
        frame = frame.f_back
    return False


def _leave(terminals: Sequence[int]) -> bool:
    """Write to nowhere in place of terminals that were closed. Is there one?"""
    gone = [number for number in terminals if not _is_terminal(number)]
    if gone:
        nowhere = os.open(os.devnull, os.O_RDWR)
        for number in gone:
            os.dup2(nowhere, number)
        os.close(nowhere)
    return bool(gone)


def _is_terminal(number: int) -> bool:
    try:
        return os.isatty(number)
    except OSError:
        return False
