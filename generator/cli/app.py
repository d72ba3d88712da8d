# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``headturn`` command.

Exit codes: 0 done, 1 failed, 2 wrong use, 3 finished but something was left out.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from generator import __version__
from generator.cli import ablate, blender, build, doctor, export, heads, preview, replay, upgrade, verify
from generator.cli.console import err, say
from generator.errors import HeadturnError
from litert_faces.installing import install_command

COMMANDS = (build, verify, preview, export, ablate, replay, upgrade, heads, doctor, blender)
"""Modules whose ``register`` adds commands."""

EXTRAS = {
    **dict.fromkeys(("bpy", "cv2", "embreex", "mediapipe", "OpenEXR", "trimesh"), "build"),
    "ray": "cluster",
}
"""The extra that brings a module along."""


def make_app() -> typer.Typer:
    """The command with all its options, as the table of settings and the registries are now."""
    app = typer.Typer(
        help="3D heads in, Parquet with exact head pose out.",
        no_args_is_help=True,
        add_completion=False,
        pretty_exceptions_enable=False,
    )
    app.callback()(_main)
    for module in COMMANDS:
        module.register(app)
    return app


def _version(value: bool) -> None:
    if value:
        say(f"headturn {__version__}")
        raise typer.Exit


def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """3D heads in, Parquet with exact head pose out."""


app = make_app()


@contextmanager
def _one_line_errors() -> Iterator[None]:
    try:
        yield
    except HeadturnError as error:
        say(f"headturn: {error}", err, style="red")
        sys.exit(error.exit_code)
    except UnicodeEncodeError as error:
        name = repr(error.object if len(error.object) < 300 else f"{error.object[:300]}...")
        say(f"headturn: {name} holds bytes that are no text in UTF-8; rename it", err, style="red")
        sys.exit(1)
    except ImportError as error:
        # What comes with an extra is missing, or a library of the system that it needs.
        name = (error.name or "").partition(".")[0]
        if name not in EXTRAS:
            raise
        missing = isinstance(error, ModuleNotFoundError)
        what = f"{name} is not installed" if missing else f"{name} cannot be imported ({error})"
        say(f"headturn: {what}: {install_command(EXTRAS[name])}", err, style="red")
        sys.exit(1)


def main() -> None:
    """Entry point of the console script."""
    with _one_line_errors():
        app()
