# SPDX-License-Identifier: MIT
"""Libraries that write to the terminal, kept from it."""

from __future__ import annotations

import contextlib
import os
import threading
from collections.abc import Iterator


class _Stderr:
    """The descriptor, which all threads share: the first to be silent puts it away, the last puts it back."""

    def __init__(self) -> None:
        self._lock, self._silent, self._kept = threading.Lock(), 0, -1

    def put_away(self) -> None:
        with self._lock:
            if not self._silent:
                self._kept, nowhere = os.dup(2), os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, 2)
                os.close(nowhere)
            self._silent += 1

    def put_back(self) -> None:
        with self._lock:
            if self._silent == 1:
                self._restore()
            self._silent = max(0, self._silent - 1)

    def after_fork(self) -> None:
        """The threads that were silent are not in the child."""
        if self._silent:
            self._restore()
        self._lock, self._silent = threading.Lock(), 0

    def _restore(self) -> None:
        os.dup2(self._kept, 2)
        os.close(self._kept)


_stderr = _Stderr()
if hasattr(os, "register_at_fork"):  # not on Windows
    os.register_at_fork(after_in_child=_stderr.after_fork)


@contextlib.contextmanager
def silence() -> Iterator[None]:
    """What native code of any thread writes to stderr meanwhile is lost."""
    _stderr.put_away()
    try:
        yield
    finally:
        _stderr.put_back()
