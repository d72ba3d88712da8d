# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs in a background Blender with the extension: what goes wrong is said, and nothing is lost.

argv after --: the folder that test_bad_input.py has laid out.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import bpy

EXTENSION = "bl_ext.user_default.headturn"
session = import_module(f"{EXTENSION}.session")
building = import_module(f"{EXTENSION}.building")
keys = import_module(f"{EXTENSION}.keys")
pictures = import_module(f"{EXTENSION}.pictures")


def until(true: Callable[[], object]) -> None:
    """Without a window nobody runs timers: do what they would do."""
    deadline = time.monotonic() + 90
    while not true():
        assert time.monotonic() < deadline, (session.state, building.current)
        session.tick()
        building.poll()
        time.sleep(0.05)


def load(folder: Path) -> str:
    """Press Load Heads; what the panel then says is wrong."""
    shown = bpy.context.scene.headturn
    shown.heads_source, shown.heads_source_folder = "FOLDER", str(folder)
    assert bpy.ops.headturn.load_heads() == {"FINISHED"}
    until(lambda: not session.conversation.is_busy)
    return session.state.error


def build(out: Path) -> str:
    """Press Build; what the panel then says."""
    scene = bpy.context.scene
    scene.headturn.out = str(out)
    building.begin(scene.headturn)
    until(lambda: building.current.exit_code is not None)
    return building.current.headline()


def kept_pictures() -> set[Path]:
    """Pictures of heads that this profile has, also those of earlier tests."""
    return set(Path(bpy.utils.extension_path_user(EXTENSION, path="thumbnails", create=True)).glob("*.png"))


def main(folder: Path) -> None:
    before = kept_pictures()
    python = os.environ.pop("HEADTURN_PYTHON")
    said = load(folder / "facescape")
    assert "press Set Up" in said, said
    os.environ["HEADTURN_PYTHON"] = python

    said = load(folder / "models-missing")
    assert f"no heads in {folder / 'models-missing'}" in said, said
    said = load(folder / "texture-missing")
    assert said.startswith("facescape-2/neutral: the texture '1_neutral.jpg' is missing"), said

    # A head is left out with its reason, the others are shown, each with its picture.
    assert load(folder / "facescape") == ""
    shown = bpy.context.scene.headturn
    state = session.state
    assert [reason.split(" is missing")[0] for reason in keys.listing(shown).skipped] == [
        "facescape-2/neutral: the texture '1_neutral.jpg'"
    ]
    shown = bpy.context.scene.headturn
    assert keys.viewed(shown) == ("facescape-1", "neutral") and len(shown.head.data.vertices) > 1000
    source, key_of = keys.placed(shown).source, import_module(f"{EXTENSION}.gallery").key_of
    until(lambda: all(pictures.kept(key_of(source, head)) for head in keys.listing(shown).heads))
    assert len(keys.listing(shown).heads) == 2
    assert len(kept_pictures() - before) == 1, "subjects 1 and 3 are the same files: one picture serves both"

    # Random poses come from the host, and each head has its own.
    scene = bpy.context.scene
    shown.poses_count, shown.on_timeline = 16, True
    for kind in ("uniform", "sobol"):
        shown.poses_kind = kind
        until(lambda: scene.frame_end == 16 and not session.conversation.is_busy)
        poses = []
        for by in (1, -1):
            scene.frame_set(5)
            poses.append((shown.yaw, shown.pitch, shown.roll))
            scene.frame_set(6)
            assert shown.yaw != poses[-1][0]
            bpy.ops.headturn.step_head(what="SUBJECT", by=by)
            until(lambda: not session.conversation.is_busy)
            until(lambda: keys.viewed(shown) == (shown.subject, shown.expression))
        scene.frame_set(5)
        assert len(set(poses)) == 2 and (shown.yaw, shown.pitch, shown.roll) == poses[0], poses
        shown.poses_same = True
        until(lambda: not session.conversation.is_busy)
        scene.frame_set(5)
        shared = shown.yaw
        bpy.ops.headturn.step_head(what="SUBJECT", by=1)
        until(lambda: not session.conversation.is_busy)
        assert shown.yaw == shared and shared not in {yaw for yaw, _, _ in poses}
        bpy.ops.headturn.step_head(what="SUBJECT", by=-1)
        until(lambda: not session.conversation.is_busy)
        shown.poses_same, shown.poses_kind, scene.frame_end = False, "grid", 1
    shown.on_timeline = False

    # The folder vanishes while it is open.
    shutil.rmtree(folder / "facescape")
    vertices = len(shown.head.data.vertices)
    bpy.ops.headturn.step_head(what="SUBJECT", by=1)
    until(lambda: not session.conversation.is_busy)
    assert str(folder / "facescape") in state.error, state.error
    assert keys.viewed(shown) == ("facescape-1", "neutral") and len(shown.head.data.vertices) == vertices
    said = build(folder / "never")
    assert building.current.exit_code == 2 and "no such file or folder" in said, said
    report = building.report().as_string()
    assert report.splitlines()[1].startswith("wrong use (exit code 2): no such file"), report

    # Another Blender builds into that folder.
    shown.heads_source, shown.heads_count = "parametric", 1
    said = build(folder / "held")
    assert building.current.exit_code == 1 and "another build (process " in said, said
    print("passed")


main(Path(sys.argv[sys.argv.index("--") + 1]))
