# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``headturn build`` does with its options, and ``headturn compact``."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from generator.cli.console import EXIT_INCOMPLETE, JsonFlag, err, out, plural
from generator.cli.reporter import JsonReporter, TerminalReporter
from generator.errors import HeadturnError
from generator.plan.config import BuildConfig


def run(
    config: BuildConfig, folder: Path, *, fresh: bool, yes: bool, as_json: bool, executor: dict[str, Any]
) -> None:
    """Build, say how it went, and end with the exit code. executor: arguments of open_executor."""
    from generator.dataset.format.manifest import portable_command
    from generator.execution.build.run import build
    from generator.execution.executors.open import open_executor
    from generator.execution.stopping import Stopped, stoppable

    reporter: Any = JsonReporter() if as_json else TerminalReporter(err)

    def confirm(what: str) -> bool:
        if yes:
            reporter.note(what)
            return True
        if as_json or not sys.stdin.isatty():
            return False
        with reporter.paused():
            return typer.confirm(f"{what}. Go on?", err=True)

    start = time.monotonic()
    command = portable_command(["headturn", *sys.argv[1:]])
    try:
        with stoppable(), reporter, open_executor(**executor) as lanes:
            result = build(config, folder, lanes, reporter, command=command, fresh=fresh, confirm=confirm)
    except Stopped as stopped:
        reporter.event("stopped", {"reason": str(stopped), "exit_code": stopped.exit_code})
        raise
    except HeadturnError as error:
        reporter.event("error", {"reason": str(error), "exit_code": error.exit_code})
        raise
    _print_result(result, time.monotonic() - start, as_json)
    if not result.complete:
        raise typer.Exit(EXIT_INCOMPLETE)


def compact(
    folder: Annotated[Path, typer.Argument(help="A finished dataset.")],
    target: Annotated[Path, typer.Option("--out", help="Folder of the new dataset.")],
    megabytes: Annotated[int, typer.Option(min=1, help="Size of a part, about.")] = 256,
    as_json: JsonFlag = False,
) -> None:
    """Merge the parts of a dataset into a few large ones, as a new dataset with the same rows."""
    from generator.dataset.format.compact import compact_dataset

    with TerminalReporter(err) as reporter:
        manifest = compact_dataset(folder, target, megabytes * 10**6, reporter=reporter)
    count, rows = len(manifest.parts), manifest.rows
    if as_json:
        typer.echo(
            json.dumps({"dataset": str(target), "parts": count, "rows": rows, "digest": manifest.digest})
        )
    else:
        out.print(f"{target}: {count} parts, {rows} rows, the same digest", soft_wrap=True)


def register(app: typer.Typer) -> None:
    """Add the commands to headturn."""
    app.command(epilog="Example: headturn compact dataset --out dataset-compact")(compact)


def _print_result(result: Any, seconds: float, as_json: bool) -> None:
    manifest = result.manifest
    rate = manifest.detected_rows / manifest.rows
    facts = {
        "dataset": str(result.root),
        "rows": manifest.rows,
        "heads": manifest.heads,
        "detection_rate": round(rate, 4),
        "skipped_heads": len(result.skipped),
        "failed_units": result.failed_units,
        "seconds": round(seconds, 1),
        "digest": manifest.digest,
        "pictures": [str(p) for p in result.pictures],
    }
    if as_json:
        typer.echo(json.dumps({"event": "finished", **facts}))
        return
    lines = [
        f"{plural(manifest.rows, 'row')} of {plural(manifest.heads, 'head')} in {seconds:.0f} s; "
        f"a face was found in {rate:.1%}",
        f"tables    {result.root / 'data'}",
        *(f"picture   {path}" for path in result.pictures),
        f"read      pandas.read_parquet({str(result.root / 'data')!r})",
        f"check     headturn verify {result.root}",
    ]
    if result.skipped:
        lines.append(f"left out  {plural(len(result.skipped), 'head')}: see {result.root / 'manifest.json'}")
    if result.failed_units:
        lines.append(f"left out  {plural(result.failed_units, 'unit')}: see {result.root / 'failures.jsonl'}")
    for line in lines:
        out.print(line, highlight=False, markup=False, soft_wrap=True)
