# SPDX-License-Identifier: GPL-3.0-or-later
"""The build of this Blender: started on the scene's settings, shown by a picture and a text."""

from __future__ import annotations

import tempfile
from pathlib import Path

import bpy

from . import pictures, session, settings
from .core.build import Build

REPORT = "Headturn report"
LAST_IMAGE = "build/last"

current = Build()


def start(scene: bpy.types.Scene) -> None:
    """Start the host on the scene's configuration. Raises HeadturnError."""
    from .core.process import HostProcess

    shown = scene.headturn
    out = settings.absolute(shown.out)
    configuration = Path(bpy.app.tempdir or tempfile.gettempdir()) / "headturn-build.toml"
    settings.save(shown, configuration)
    arguments = ["build", str(configuration), "--out", out, "--json"]
    if shown.workers:
        arguments += ["--workers", str(shown.workers)]
    current.start(HostProcess(session.host_command(arguments)), Path(out))


def forget() -> None:
    """What the last build came to no longer counts."""
    current.forget()
    pictures.forget(LAST_IMAGE)


def poll() -> bool:
    """Take in what the host said. True if anything changed."""
    newest = current.newest
    changed = current.poll()
    if current.newest is not None and current.newest != newest:
        pictures.keep(LAST_IMAGE, current.newest)
        changed = True
    if changed and current.report:
        text = bpy.data.texts.get(REPORT) or bpy.data.texts.new(REPORT)
        text.clear()
        text.write(current.report)
    return changed
