# SPDX-License-Identifier: GPL-3.0-or-later
"""What the Blender extension asks of its host: hidden commands, not meant to be typed."""

from __future__ import annotations

import json
import sys
from importlib.metadata import PackageNotFoundError, version
from typing import Annotated

import typer

from generator import __version__

PARTS = ("bpy", "mediapipe", "pyarrow", "anny")
"""Distributions that a build, or a part of it, needs besides what every command needs."""


def environment() -> None:
    """Print one JSON object: the versions of Headturn, Python and what a build needs; null if missing."""
    found: dict[str, str | None] = {"headturn": __version__, "python": sys.version.split()[0]}
    for name in PARTS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = None
    typer.echo(json.dumps(found))


def preview_server(
    blender: Annotated[str | None, typer.Option("--blender", help="A Blender executable.")] = None,
    blender_of_scenes: Annotated[
        str | None, typer.Option("--blender-of-scenes", help="Another one, for heads in Blender scenes.")
    ] = None,
) -> None:
    """Serve previews over stdin and stdout; see generator/execution/preview/server.py."""
    from generator.execution.preview.server import serve

    serve(blender, blender_of_scenes)


def register(app: typer.Typer) -> None:
    """Add both commands."""
    app.command("environment", hidden=True)(environment)
    app.command("preview-server", hidden=True)(preview_server)
