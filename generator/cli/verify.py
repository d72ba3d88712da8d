# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn verify``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from generator.cli.console import JsonFlag, err
from generator.cli.reporter import TerminalReporter


def verify(
    folder: Annotated[Path, typer.Argument(help="A dataset made by headturn build.")],
    quick: Annotated[
        bool, typer.Option("--quick", help="Sizes, footers and row counts only; contents are not read.")
    ] = False,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Processes; default one a core where it pays.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Prove that every row of the plan is there once, labels agree and hashes match."""
    from generator.dataset.proof.verify import verify_dataset

    with TerminalReporter(err) as reporter:

        def step(done: int, total: int) -> None:
            if done == 1 and err.is_terminal:
                reporter.stage("verifying", total)
            reporter.advance()

        report = verify_dataset(folder, quick=quick, workers=workers, progress=step)
    typer.echo(json.dumps(report.as_dict(), indent=1) if as_json else report.text())
    if not report.ok:
        raise typer.Exit(1)


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog="Example: headturn verify dataset")(verify)
