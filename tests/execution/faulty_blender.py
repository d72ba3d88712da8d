#!/usr/bin/env python
# SPDX-License-Identifier: GPL-3.0-or-later
"""A Blender with a fault, to be given as --blender; see test_faults.py for how it is installed.

FAULT says what happens at the pose of FAULT_YAW: crash, hang or grow. With
FAULT_ONCE, a file that does not exist yet, it happens a single time.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from pathlib import Path

from generator.blender import images, worker
from generator.plan.views import View

GROWN = []


def crash() -> None:
    os.kill(os.getpid(), signal.SIGSEGV)


def hang() -> None:
    time.sleep(600)


def grow() -> None:
    GROWN.append(b"x" * 2**30)


FAULTS = {"crash": crash, "hang": hang, "grow": grow}
render_well = images.Images.render


def render(self: images.Images, view: View, path: Path, *environment: object) -> None:
    once = os.environ.get("FAULT_ONCE")
    if view.pose[0] == float(os.environ["FAULT_YAW"]) and not (once and Path(once).exists()):
        if once:
            Path(once).touch()
        print("this is the faulty pose", file=sys.stderr, flush=True)
        FAULTS[os.environ["FAULT"]]()
    render_well(self, view, path, *environment)


if "--version" in sys.argv:
    print("Blender 4.5.0")
    sys.exit()
images.Images.render = render
worker.main(threads=int(sys.argv[-1]))
