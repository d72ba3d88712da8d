# SPDX-License-Identifier: GPL-3.0-or-later
"""A function over many things in several processes, for those that have no order of their own to keep.

What :mod:`multiprocessing` spawns looks for modules in the current folder on Python 3.10, and runs its
caller's script once more; these are started as every process of ours is. stdlib only.
"""

from __future__ import annotations

import os
import pickle
import queue
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from itertools import chain
from typing import Any, Protocol

from generator.errors import WorkerError
from generator.interpreter import python_command, python_environment
from generator.platforms import HERE
from generator.process import end_with_parent


class Spread(Protocol):
    """As map: the results in the order of the items. What the function raises is raised here."""

    def __call__(self, function: Callable[..., Any], items: Sequence[Any], chunk: int) -> Iterator[Any]:
        """function: of a module, or a partial of one. chunk: items that a process takes at a time."""
        ...


@contextmanager
def processes(count: int, prepare: Callable[[], None]) -> Iterator[Spread]:
    """Processes that first call prepare. WorkerError, while they work, if one is killed."""
    idle: queue.SimpleQueue[_Process] = queue.SimpleQueue()
    started = [_Process(prepare) for _ in range(count)]
    for process in started:
        idle.put(process)

    def carry_out(function: Callable[..., Any], some: Sequence[Any]) -> list[Any]:
        process = idle.get()
        try:
            return process.ask(function, some)
        finally:
            idle.put(process)

    def spread(function: Callable[..., Any], items: Sequence[Any], chunk: int) -> Iterator[Any]:
        pieces = [items[k : k + chunk] for k in range(0, len(items), chunk)]
        answers = [threads.submit(carry_out, function, piece) for piece in pieces]
        return chain.from_iterable(answer.result() for answer in answers)

    threads = ThreadPoolExecutor(count)
    try:
        yield spread
    finally:
        for process in started:
            process.kill()
        threads.shutdown(cancel_futures=True)


class _Process:
    def __init__(self, prepare: Callable[[], None]) -> None:
        self._child = subprocess.Popen(
            python_command("generator.pool"),
            env=python_environment(),
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            **HERE.own_group(),
        )
        self._prepare: Callable[[], None] | None = prepare

    def ask(self, function: Callable[..., Any], some: Sequence[Any]) -> list[Any]:
        assert self._child.stdin is not None and self._child.stdout is not None
        try:
            pickle.dump((self._prepare, function, some), self._child.stdin)
            self._child.stdin.flush()
            answer, error = pickle.load(self._child.stdout)
        except (EOFError, OSError, ValueError, pickle.UnpicklingError) as broken:
            raise WorkerError("a process was killed") from broken
        if error is not None:
            raise error
        self._prepare = None
        return answer

    def kill(self) -> None:
        self._child.kill()
        self._child.wait()
        assert self._child.stdin is not None and self._child.stdout is not None
        with suppress(OSError):  # half a question may be in it
            self._child.stdin.close()
        self._child.stdout.close()


def main() -> None:
    """Answer questions from stdin until it closes."""
    end_with_parent()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # whatever a library prints is no answer
    while True:
        try:
            prepare, function, some = pickle.load(sys.stdin.buffer)
        except EOFError:
            return
        try:
            if prepare is not None:
                prepare()
            answer: tuple[list[Any], Exception | None] = [function(item) for item in some], None
        except Exception as error:  # raised where it was asked
            answer = [], error
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    main()
