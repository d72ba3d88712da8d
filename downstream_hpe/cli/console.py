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
from litert_faces.installing import numpy_clash

EXTRAS = {
    **dict.fromkeys(("torch", "onnx", "safetensors"), "hpe"),
    **dict.fromkeys(("pyarrow", "matplotlib"), "tables"),
    **dict.fromkeys(("onnxruntime", "mediapipe", "cv2", "av"), "pose"),
}
"""The extra that brings a module along."""

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
    except ImportError as error:
        if (line := numpy_clash(error)) is not None:
            note(f"downstream-hpe: {line}", style="red")
            sys.exit(1)
        # What comes with an extra is missing, or a library of the system that it needs.
        name = (error.name or "").partition(".")[0]
        if name not in EXTRAS:
            raise
        from downstream_hpe.release import install

        missing = isinstance(error, ModuleNotFoundError)
        what = f"{name} is not installed" if missing else f"{name} cannot be imported ({error})"
        note(f"downstream-hpe: {what}: {install(EXTRAS[name])}")
        sys.exit(1)
    except UnicodeEncodeError as error:
        name = repr(error.object if len(error.object) < 300 else f"{error.object[:300]}...")
        note(f"downstream-hpe: {name} holds bytes that are no text in UTF-8; rename it")
        sys.exit(1)
    except OSError as error:
        note(f"downstream-hpe: {error}")
        sys.exit(1)
    except KeyboardInterrupt:
        further = "; run the same command again to continue" if sys.argv[1:2] == ["fit"] else ""
        note(f"downstream-hpe: stopped{further}")
        sys.exit(130)
