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
from generator.cli import blender, build, export, heads, preview, replay, upgrade, verify
from generator.cli.console import err, say
from generator.errors import HeadturnError

COMMANDS = (build, verify, preview, export, replay, upgrade, heads, blender)
"""Modules whose ``register`` adds commands."""


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


def main() -> None:
    """Entry point of the console script."""
    with _one_line_errors():
        app()
