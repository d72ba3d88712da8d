# SPDX-License-Identifier: GPL-3.0-or-later
"""A lane as a process of its own, started by :mod:`generator.execution.lanes.lane_process`."""

from __future__ import annotations

import json
import os
import sys
from typing import Any

from generator.errors import HeadturnError
from generator.process import end_with_parent


def main() -> None:
    """Serve orders from stdin; the first line holds the options."""
    # First of all: what a lane imports takes seconds, in which its host may die.
    end_with_parent()
    import cv2

    from generator.codec import from_plain
    from generator.execution.lanes.lane import Lane
    from generator.execution.lanes.options import LaneOptions
    from generator.messages import LaneFailed, LaneReady, Progressed, from_json, to_json

    receipts = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever a library prints goes to the log

    def answer(message: Any) -> None:
        receipts.write(json.dumps(to_json(message)) + "\n")

    answer(LaneReady(os.getpid()))
    options = from_plain(LaneOptions, json.loads(sys.stdin.readline()))
    if options.cpus and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, options.cpus)  # inherited by the render worker
    cv2.setNumThreads(1)
    lane: Lane | None = None
    try:
        for line in sys.stdin:
            try:
                if lane is None:
                    lane = Lane(options)
                answer(lane.run(from_json(json.loads(line)), lambda: answer(Progressed())))
            except HeadturnError as error:
                answer(LaneFailed(str(error), _kind(error), getattr(error, "log", "")))
    finally:
        if lane is not None:
            lane.close()


def _kind(error: HeadturnError) -> str:
    """The class of generator.errors that an error is of, or comes from: the host knows no others."""
    return next(kind.__name__ for kind in type(error).__mro__ if kind.__module__ == HeadturnError.__module__)


if __name__ == "__main__":
    main()
