# SPDX-License-Identifier: GPL-3.0-or-later
"""A sitting: no environment, one that is set up, one that is named and checked, heads that are not there."""

from __future__ import annotations

import os
import shutil
import sys
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import bpy

sys.path.insert(0, str(Path(__file__).parent))

from ui_steps import begin, building, press_build, press_load, session, shown, state, to_the_end  # isort: skip
from ui_driver import EXTENSION, OUT, Step, area, click, drive, scroll, shot, widgets


def steps() -> Iterator[Step]:
    """Every step in order; each relies on the one before."""
    python = os.environ.pop("HEADTURN_PYTHON")
    yield from begin()
    shot("01-empty")

    # Build without an environment: how to install one. Then its name, and Check.
    shown().out = str(OUT / "never")
    yield from to_the_end()
    yield from press_build()
    yield lambda: building.current.refused
    assert "press Set Up" in building.current.refused, state.error
    yield 0.3
    shot("02-no-environment")
    yield from scroll(-60)
    yield from set_up(python)
    yield from check_button(python)
    assert state.facts is not None and not state.host_error

    # The Load button, with a folder that does not exist: a message, no traceback.
    shown().heads_source = "FOLDER"
    shown().heads_source_folder = "/nowhere/heads"
    yield 0.3
    yield from press_load()
    yield lambda: bool(state.error)
    assert "/nowhere/heads" in state.error, state.error
    yield 0.3
    shot("04-no-such-folder")


FAKE = """#!/bin/sh
# A Python that says it is one, and makes an environment whose pip only talks.
case "$*" in
    *ensurepip*) echo "[3, 11]" ;;
    *"-m venv "*) for folder; do :; done; mkdir -p "$folder/bin"; cp "$0" "$folder/bin/python" ;;
    *"-m pip "*)
        echo Collecting bpy
        echo "  Downloading w/bpy-4.5.15.whl (350 MB)"
        while [ -e {hold} ]; do sleep 0.1; done ;;
    *) exec {python} "$@" ;;
esac
"""


def set_up(python: str) -> Iterator[Step]:
    """Without any Python, without patience, and to the end."""
    setting_up = import_module(f"{EXTENSION}.setting_up")
    current, folder = setting_up.current, import_module(f"{EXTENSION}.folders").environment()
    assert bpy.ops.headturn.set_up() == {"FINISHED"}
    yield lambda: not current.runs
    assert "no Python 3.11" in current.error and "uv python install 3.11" in current.commands, current.error
    yield 0.5
    shot("02-no-python")

    hold, fake = OUT / "hold", OUT / "bin" / "python3.11"
    fake.parent.mkdir()
    fake.write_text(FAKE.format(hold=hold, python=python), encoding="utf-8")
    fake.chmod(0o755)
    hold.touch()
    os.environ["PATH"] = f"{fake.parent}:{os.environ['PATH']}"
    assert bpy.ops.headturn.set_up() == {"FINISHED"} and not bpy.ops.headturn.set_up.poll()
    yield lambda: current.line.startswith("fetching bpy")
    yield 0.5
    shot("02-setting-up")
    assert bpy.ops.headturn.cancel_set_up() == {"FINISHED"}
    yield lambda: not current.runs
    assert (current.line, current.error) == ("stopped", "") and session.set_up() is None

    # The button itself, the second of the tab. Another file does it no harm.
    yield 0.5
    _, button, *_ = yield from widgets("buttons")
    yield from click(*button.middle)
    yield lambda: current.line.startswith("fetching bpy")
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_factory_startup_app_template_only=True)
    yield 1.0
    hold.unlink()
    yield from begin()
    yield lambda: not current.runs
    assert not current.error and current.line.startswith("Headturn "), (current.line, current.error)
    yield lambda: state.facts is not None or bool(state.host_error)
    assert state.host.found_by == "Set Up" and session.set_up() == folder, (state.host, state.host_error)
    yield 0.5
    shot("02-set-up")
    bpy.ops.headturn.copy(text="headturn build")
    assert bpy.context.window_manager.clipboard == "headturn build"
    shutil.rmtree(folder)
    session.forget_host()


def check_button(python: str) -> Iterator[Step]:
    """Name the environment in the preferences and press Check."""
    preferences = bpy.context.preferences
    view = area()
    view.type = "PREFERENCES"
    preferences.active_section = "ADDONS"
    bpy.context.window_manager.addon_search = "Headturn"
    bpy.ops.preferences.addon_expand(module=EXTENSION)
    preferences.addons[EXTENSION].preferences.python = python
    yield 0.5
    buttons = yield from widgets("buttons", "PREFERENCES", "WINDOW")
    yield from click(*buttons[0].middle)
    yield lambda: state.facts is not None or bool(state.host_error)
    yield 0.3
    shot("03-checked")
    view.type = "VIEW_3D"
    yield 0.3


drive(steps)
