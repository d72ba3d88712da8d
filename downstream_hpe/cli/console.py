# SPDX-License-Identifier: MIT
"""What the command says on stderr: notes, progress, and every error in one line."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from downstream_hpe.errors import HpeError
from downstream_hpe.escape import printable

JsonFlag = Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")]

# Without emoji, which rich would make of what stands between colons, as in webcam:-1: expected ...
err = Console(stderr=True, emoji=False, markup=False)


def note(text: str, style: str = "") -> None:
    """One line on stderr, as it is; nothing in it is an order to the terminal."""
    err.print(printable(text), style=style, highlight=False, markup=False, soft_wrap=True)


def say(text: str) -> None:
    """One line on stdout, as it is; nothing in it is an order to the terminal."""
    typer.echo(printable(text))


def progress() -> Progress:
    """A bar of a training, with its loss; nothing where stderr is no terminal."""
    return Progress(
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[loss]}"),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=err,
        disable=not err.is_terminal,
    )


@contextlib.contextmanager
def one_line_errors() -> Iterator[None]:
    """Ends the process with the exit code of the error, after its line."""
    try:
        yield
    except HpeError as error:
        note(f"downstream-hpe: {error}", style="red")
        sys.exit(error.exit_code)
    except ModuleNotFoundError as error:
        # The learning side is an extra of the distribution.
        if error.name not in ("torch", "onnx", "onnxruntime", "safetensors"):
            raise
        note(f"downstream-hpe: {error.name} is not installed: pip install 'headturn[hpe]'")
        sys.exit(1)
    except OSError as error:
        note(f"downstream-hpe: {error}")
        sys.exit(1)
    except KeyboardInterrupt:
        note("downstream-hpe: stopped; run the same command again to continue")
        sys.exit(130)
