# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn verify``."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Annotated

import typer

from generator.cli.console import EXIT_INCOMPLETE, BlenderOption, JsonFlag, err, say
from generator.cli.reporter import TerminalReporter
from generator.errors import UsageError
from generator.limits import MAX_WORKERS


def verify(
    folder: Annotated[Path, typer.Argument(help="A dataset made by headturn build.")],
    quick: Annotated[
        bool, typer.Option("--quick", help="Sizes, footers and row counts only; contents are not read.")
    ] = False,
    digest: Annotated[
        str | None,
        typer.Option(metavar="HEX", help="Fail unless this is the digest or the Merkle root of the rows."),
    ] = None,
    deep: Annotated[
        str | None,
        typer.Option(
            metavar="N|all",
            help="Decode the images of N rows, render them again from their heads, and compare.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Chooses the N rows; take one that nobody expects.")] = 0,
    heads: Annotated[
        Path | None, typer.Option(help="For --deep: where the head source lies now, if it moved.")
    ] = None,
    blender: BlenderOption = None,
    workers: Annotated[
        int | None, typer.Option(min=1, max=MAX_WORKERS, help="Processes; default one a core where it pays.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Prove that every row of the plan is there once, labels agree and hashes match.

    It does not prove that images show what was recorded: --deep renders some or all of them again, and needs
    the heads and the versions of the build. Nor does it prove that nobody made it all anew, hashes included:
    give --digest the Merkle root that the dataset's maker tells you. The digest is a checksum, which finds
    damage but no deceit.

    Exit code 1 if anything is wrong, 3 if nothing is wrong but --deep could not render all rows it chose.
    """
    from generator.dataset.proof.verify import verify_dataset

    if quick and (digest, deep) != (None, None):
        raise UsageError("--digest and --deep need every row read; leave --quick out")
    if deep is None and (seed, heads, blender) != (0, None, None):
        raise UsageError("--seed, --heads and --blender are for --deep; give --deep N or --deep all")
    expected = None if digest is None else _hex(digest)
    count = None if deep is None else _count(deep)
    with TerminalReporter(err) as reporter:

        def step(done: int, total: int) -> None:
            if done == 1 and err.is_terminal:
                reporter.stage("verifying", total)
            reporter.advance()

        report = verify_dataset(folder, quick=quick, expected=expected, workers=workers, progress=step)
        if count is not None:
            from generator.execution.deep import look_deep

            report = look_deep(
                report,
                folder,
                None if count == ALL else count,
                seed=seed,
                heads=heads,
                blender=blender,
                workers=workers,
                on_start=lambda total: reporter.stage("rendering again", total),
                on_image=reporter.advance,
            )
    if as_json:
        typer.echo(json.dumps(report.as_dict(), indent=1))
    else:
        for line in report.text().split("\n"):
            say(line)
    if not report.ok:
        raise typer.Exit(1)
    if report.deep is not None and not report.deep.complete:
        raise typer.Exit(EXIT_INCOMPLETE)


ALL = 0
"""As a count of rows: every one."""


def _count(deep: str) -> int:
    if deep == "all":
        return ALL
    if not re.fullmatch(r"[1-9][0-9]{0,17}", deep):
        raise UsageError(f"--deep {deep[:80]!r}: expected a number of rows from 1 on, or all")
    return int(deep)


def _hex(digest: str) -> str:
    if not re.fullmatch(r"[0-9a-fA-F]{64}", digest):
        raise UsageError(
            f"--digest {digest[:80]!r}: expected 64 hexadecimal digits, as headturn verify prints"
        )
    return digest.lower()


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog="Example: headturn verify dataset --deep 20")(verify)
