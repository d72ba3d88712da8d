# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs in a background Blender with the extension: builds for hours into the folder after --."""

from __future__ import annotations

import json
import os
import sys
import time
from importlib import import_module
from pathlib import Path

import bpy

out = Path(sys.argv[sys.argv.index("--") + 1])
session = import_module("bl_ext.user_default.headturn.session")
building = import_module("bl_ext.user_default.headturn.building")
build = building.current
shown = bpy.context.scene.headturn
shown.heads_count, shown.render_resolution, shown.workers, shown.out = 1, 64, 1, str(out)
shown.poses_yaw = shown.poses_pitch = (-40, 40, 1)
building.begin(shown)
FIRST_PART = 100
"""Images of a part: when there are more, it was committed."""

marked = False
while build.exit_code is None:
    session.tick()
    building.poll()
    if build.runs and build.progress.stage == "rendering" and build.progress.done > FIRST_PART and not marked:
        marked = True
        pids = {"blender": os.getpid(), "host": build.process.pid}
        out.with_suffix(".json").write_text(json.dumps(pids), encoding="utf-8")
    time.sleep(0.05)
print(build.headline(), build.process)
