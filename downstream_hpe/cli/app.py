# SPDX-License-Identifier: MIT
"""The ``downstream-hpe`` command.

Exit codes: 0 done, 1 failed, 2 wrong use, 3 finished with something left out, 130 stopped.
"""

from __future__ import annotations

import typer

from downstream_hpe.cli.console import one_line_errors
from downstream_hpe.cli.evaluate import evaluate
from downstream_hpe.cli.export import export
from downstream_hpe.cli.fit import fit
from downstream_hpe.cli.predict import predict

app = typer.Typer(
    help="Learn pose manifolds from Headturn's tables and estimate head pose.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command(epilog="Example: downstream-hpe fit dataset --out model --missing keep")(fit)
app.command(epilog="Example: downstream-hpe evaluate model other_heads --out report")(evaluate)
app.command(epilog="Example: downstream-hpe predict photo.jpg --draw drawn")(predict)
app.command(epilog="Example: downstream-hpe export model --onnx pose.onnx --weights pose.safetensors")(export)


def main() -> None:
    """Entry point of the console script."""
    with one_line_errors():
        app()
