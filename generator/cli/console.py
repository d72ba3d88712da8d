# SPDX-License-Identifier: GPL-3.0-or-later
"""What every command shares: the two output streams, the door to both, --json, and an exit code."""

from __future__ import annotations

import sys
from typing import Annotated

import typer
from rich.console import Console
from rich.text import Text

from generator.escape import printable

EXIT_INCOMPLETE = 3
"""Finished, but something was left out."""

# A pipe has no width of its own; 80 columns would cut every table.
# Without emoji and markup: a path may hold ":x:" or "[x]".
out = Console(width=None if sys.stdout.isatty() else 160, emoji=False, markup=False)
err = Console(stderr=True, emoji=False, markup=False)


def say(text: str, console: Console = out, style: str = "") -> None:
    """Print a line as it is: no markup, not broken, and nothing in it is an order to the terminal."""
    console.print(shown(text), style=style, highlight=False, soft_wrap=True)


def shown(text: object) -> Text:
    """A cell or a line that rich leaves as it is."""
    return Text(printable(str(text)))


JsonFlag = Annotated[bool, typer.Option("--json", help="JSON on stdout, for machines.")]

BlenderOption = Annotated[
    str | None,
    typer.Option("--blender", help="A Blender executable (4.2 or newer) instead of the bpy wheel."),
]
