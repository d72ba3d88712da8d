# SPDX-License-Identifier: MIT
"""The ``downstream-hpe`` command.

Exit codes: 0 done, 1 failed, 2 wrong use, 3 finished with something left out, 130 stopped.
"""

from __future__ import annotations

from typing import Annotated

import typer

from downstream_hpe.cli.console import one_line_errors, say
from downstream_hpe.cli.demo import demo
from downstream_hpe.cli.doctor import doctor
from downstream_hpe.cli.evaluate import evaluate
from downstream_hpe.cli.export import export
from downstream_hpe.cli.fit import fit
from downstream_hpe.cli.predict import predict

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


def _say_version(wanted: bool) -> None:
    if wanted:
        from downstream_hpe.release import __version__

        say(f"downstream-hpe {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_say_version, is_eager=True)
    ] = False,
) -> None:
    """Learn pose manifolds from Headturn's tables and estimate head pose."""


app.command(epilog="Example: downstream-hpe fit dataset --out model --missing keep")(fit)
app.command(epilog="Example: downstream-hpe evaluate model other_heads --out report")(evaluate)
app.command(epilog="Example: downstream-hpe predict photo.jpg --draw drawn")(predict)
app.command(epilog="Example: downstream-hpe export headturn --onnx pose.onnx")(export)
app.command(epilog="Example: downstream-hpe demo --port 8765")(demo)
app.command(epilog="Example: downstream-hpe doctor --json")(doctor)


def main() -> None:
    """Entry point of the console script."""
    with one_line_errors():
        app()
