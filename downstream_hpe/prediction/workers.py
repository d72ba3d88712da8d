# SPDX-License-Identifier: MIT
"""Several processes that look at files side by side; what they say comes in the order of the files."""

from __future__ import annotations

import multiprocessing
import signal
import sys
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.prediction.cameras import CameraOf
from downstream_hpe.prediction.inputs import Source
from downstream_hpe.prediction.predictions import Options, predictions
from downstream_hpe.prediction.predictor import Predictor
from downstream_hpe.prediction.records import Record

TOGETHER = 8
"""Pictures that are given to a process at once; a video is given alone."""
AHEAD = 3
"""So many portions a process are on their way, so that memory does not grow with the number of files."""


@dataclass(frozen=True)
class Work:
    """What every process opens for itself. options: but for the camera."""

    predictor: Callable[[], Predictor]
    camera: Callable[[], CameraOf]
    options: Options


def predictions_side_by_side(
    every: Sequence[Source], work: Work, workers: int, leave_out: Callable[[str], None]
) -> Generator[Record, None, None]:
    """As :func:`predictions`, by so many processes.

    Raises
    ------
    UsageError: a webcam, an address or a pipe; Python 3.10. DataError: a process was ended.
    """
    if sys.version_info < (3, 11):
        # It would look for modules in the current folder; later versions know PYTHONSAFEPATH.
        raise UsageError("--workers needs Python 3.11 or newer")
    for source in every:
        if source.alone:
            raise UsageError(f"{source.name}: --workers is for files")
    # Not forked: what finds faces has threads.
    spawn = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(workers, spawn, initializer=_begin, initargs=(work,))
    waiting: deque[Future[list[Record | str]]] = deque()
    portions = _portions(every)
    try:
        while True:
            while len(waiting) < AHEAD * workers and (portion := next(portions, None)) is not None:
                waiting.append(pool.submit(_look, portion))
            if not waiting:
                return
            for said in waiting.popleft().result():
                if isinstance(said, str):
                    leave_out(said)
                else:
                    yield said
    except BrokenProcessPool as error:
        raise DataError("a process was ended, for want of memory, perhaps; take fewer --workers") from error
    finally:
        children = multiprocessing.active_children() if waiting else []
        pool.shutdown(wait=not waiting, cancel_futures=True)
        for child in children:
            child.terminate()


def _portions(every: Sequence[Source]) -> Iterator[list[Source]]:
    portion: list[Source] = []
    for source in every:
        if portion and (source.moving or portion[0].moving or len(portion) == TOGETHER):
            yield portion
            portion = []
        portion.append(source)
    if portion:
        yield portion


_work: Work | None = None
_opened: tuple[Predictor, Options] | None = None


def _begin(work: Work) -> None:
    global _work
    _work = work
    # Ctrl-C goes to all; the first process ends the others.
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _look(portion: list[Source]) -> list[Record | str]:
    """Records, and a line each for what is left out, in their order."""
    global _opened
    if _work is None:
        raise ValueError("a process without work")
    if _opened is None:
        _opened = _work.predictor(), replace(_work.options, camera=_work.camera())
    said: list[Record | str] = []
    for row in predictions(portion, *_opened, said.append):
        said.append(row)
    return said
