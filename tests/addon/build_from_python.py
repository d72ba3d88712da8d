# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs in a background Blender with the extension: builds from Python, into the folder after --."""

from __future__ import annotations

import os
import sys
from importlib import import_module
from pathlib import Path

import bpy

EXTENSION = "bl_ext.user_default.headturn"


def refused(expected: str) -> None:
    """Build, and see it fail with a line that says this."""
    try:
        bpy.ops.headturn.build()
    except RuntimeError as error:
        assert expected in str(error) and "Traceback" not in str(error), error
    else:
        raise AssertionError("it went through")


def main(out: Path) -> None:
    building = import_module(f"{EXTENSION}.building")
    shown = bpy.context.scene.headturn
    refused("Choose the folder of the dataset first")

    shown.heads_count, shown.render_resolution, shown.workers, shown.out = 1, 64, 1, str(out / "tiny")
    shown.poses_yaw, shown.poses_pitch, shown.poses_roll = (-20, 20, 20), (0, 0, 10), (0, 0, 10)
    assert bpy.ops.headturn.build() == {"FINISHED"}, "it waits for the end"
    assert (out / "tiny" / "manifest.json").is_file() and building.current.progress.result["rows"] == 3
    assert building.last_rate() is None, "three images tell nothing of many"

    (out / "foreign").mkdir()
    (out / "foreign" / "diary.txt").write_text("mine", encoding="utf-8")
    shown.out = str(out / "foreign")
    refused("not empty and not a Headturn dataset")

    os.environ["HEADTURN_PYTHON"] = "/nowhere/python"
    import_module(f"{EXTENSION}.session").forget_host()
    refused("/nowhere/python is no Python")

    # What another Blender of anybody has is not ours, and ours has no name that anybody could guess.
    folders = import_module(f"{EXTENSION}.folders")
    scratch = folders.scratch("pictures")
    assert scratch.is_relative_to(bpy.app.tempdir) and scratch.parent.stat().st_mode & 0o77 == 0
    print("passed")


main(Path(sys.argv[sys.argv.index("--") + 1]))
