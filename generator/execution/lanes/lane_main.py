# SPDX-License-Identifier: GPL-3.0-or-later
"""A lane as a process of its own: ``python -m generator.execution.lanes.lane_main``."""

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

    from generator.execution.lanes.lane import Lane, LaneOptions

    receipts = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)  # whatever a library prints goes to the log

    def answer(receipt: dict[str, Any]) -> None:
        receipts.write(json.dumps(receipt) + "\n")

    answer({"ready": os.getpid()})
    options = json.loads(sys.stdin.readline())
    if options["cpus"] and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, options["cpus"])  # inherited by the render worker
    cv2.setNumThreads(1)
    lane: Lane | None = None
    try:
        for line in sys.stdin:
            try:
                if lane is None:
                    lane = Lane(LaneOptions(**{**options, "cpus": tuple(options["cpus"])}))
                answer({"receipt": lane.run(json.loads(line), lambda: answer({"frame": 1}))})
            except HeadturnError as error:
                log = getattr(error, "log", "")
                answer({"error": str(error), "type": type(error).__name__, "log": log})
    finally:
        if lane is not None:
            lane.close()


if __name__ == "__main__":
    main()
