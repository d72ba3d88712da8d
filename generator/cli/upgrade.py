# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn upgrade``: a dataset of an earlier schema as one of today's."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from generator.cli.console import JsonFlag, err, say
from generator.cli.reporter import TerminalReporter
from generator.words import plural


def upgrade(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="A finished dataset.")],
    target: Annotated[
        Path | None, typer.Option("--out", help="Write it there and leave DIR as it is; else in its place.")
    ] = None,
    as_json: JsonFlag = False,
) -> None:
    """Rewrite a dataset to the schema of this version. Every command also reads it as it is.

    The columns that it lacks hold their defaults, so its digest changes. Rows and labels do not.
    """
    from generator.dataset.format.upgrade import upgrade_dataset
    from generator.execution.build.lock import LOCK_FILE, locked

    if target is None and (folder / LOCK_FILE).exists():
        with locked(folder):
            pass  # or one line, if a build is at work there
    with TerminalReporter(err) as reporter:
        done = upgrade_dataset(folder, target, reporter=reporter)
    now = done.manifest.schema_version
    if as_json:
        facts = {"dataset": str(done.root), "changed": done.changed, "before": done.before}
        typer.echo(json.dumps({**facts, "schema_version": now, "digest": done.manifest.digest}))
    elif done.changed:
        say(
            f"{done.root}: schema {done.before} -> {now}, {plural(done.manifest.rows, 'row')}, "
            f"digest {done.manifest.digest}"
        )
    else:
        say(f"{done.root}: of schema {now} already, nothing to do")


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog="Example: headturn upgrade dataset --out dataset-upgraded")(upgrade)
