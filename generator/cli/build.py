# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn build`` and ``headturn compact``."""

from __future__ import annotations

import json
import shlex
import sys
import time
from pathlib import Path
from typing import Annotated, Any

import typer

from generator import registries
from generator.cli.console import EXIT_INCOMPLETE, BlenderOption, JsonFlag, err, say
from generator.cli.options import with_settings
from generator.cli.reporter import JsonReporter, TerminalReporter
from generator.errors import HeadturnError
from generator.escape import printable
from generator.execution.lanes.options import CPU, DEADLINE_S, DEVICES
from generator.heads.head import is_scene
from generator.limits import MAX_WORKERS
from generator.plan.config import BuildConfig, load_config
from generator.plan.settings import Values, all_settings
from generator.words import plural


def build(
    config_file: Annotated[
        Path | None,
        typer.Argument(
            metavar="[CONFIG.toml|SCENE.blend]",
            help="Configuration, or a Blender scene with the head; flags override it.",
        ),
    ] = None,
    folder: Annotated[Path, typer.Option("--out", help="Folder of the dataset.")] = Path("dataset"),
    workers: Annotated[
        int | None,
        typer.Option(
            min=1, max=MAX_WORKERS, help="Lanes, a render worker and a detector each; default one a core."
        ),
    ] = None,
    executor: Annotated[
        str,
        typer.Option(
            metavar="|".join(registries.EXECUTORS), help="local, ray for a cluster, or serial for debugging."
        ),
    ] = "local",
    address: Annotated[
        str | None, typer.Option(help="Ray cluster, such as auto; without it Ray runs here alone.")
    ] = None,
    deadline: Annotated[
        float, typer.Option(min=1, max=10**9, help="Seconds of silence after which a worker is replaced.")
    ] = DEADLINE_S,
    memory: Annotated[
        float | None,
        typer.Option(
            min=0,
            max=10**9,
            help="MiB a lane may grow to; default 80 % of the machine's, or its container's, for all.",
        ),
    ] = None,
    device: Annotated[
        str,
        typer.Option(
            metavar="|".join(DEVICES), help="What images are rendered on; auto is a GPU where there is one."
        ),
    ] = CPU,
    fresh: Annotated[bool, typer.Option("--fresh", help="Delete the dataset that is there first.")] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask before deleting.")] = False,
    blender: BlenderOption = None,
    as_json: JsonFlag = False,
    *,
    overrides: Values,
) -> None:
    """Render every head at every pose, find the landmarks, write the tables.

    Run it again to continue a build that was interrupted, or with more heads or
    poses to extend it.
    """
    if config_file is not None and is_scene(config_file):
        overrides.setdefault("heads", {}).setdefault("source", str(config_file))
        config_file = None
    run(
        load_config(config_file, overrides),
        folder,
        fresh=fresh,
        yes=yes,
        as_json=as_json,
        executor={
            "name": executor,
            "workers": workers,
            "blender": blender,
            "deadline_s": deadline,
            "memory_mib": memory,
            "device": device,
            "address": address,
        },
    )


def run(
    config: BuildConfig, folder: Path, *, fresh: bool, yes: bool, as_json: bool, executor: dict[str, Any]
) -> None:
    """Build, say how it went, and end with the exit code. executor: arguments of open_executor."""
    from generator.dataset.format.manifest import portable_command
    from generator.execution.build.run import build as build_dataset
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
            return typer.confirm(printable(f"{what}. Go on?"), err=True)

    start = time.monotonic()
    command = portable_command(["headturn", *sys.argv[1:]])
    try:
        with stoppable(), reporter, open_executor(**executor) as lanes:
            result = build_dataset(
                config, folder, lanes, reporter, command=command, fresh=fresh, confirm=confirm
            )
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
    megabytes: Annotated[
        int, typer.Option(min=1, max=10**6, help="Megabytes of a part, a Parquet file, about.")
    ] = 256,
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
        say(f"{target}: {plural(count, 'part')}, {plural(rows, 'row')}, the same digest")


def register(app: typer.Typer) -> None:
    """Add the commands."""
    example = "Example: headturn build --heads my_heads --yaw -50,50,10 --preset quality --out dataset"
    app.command(epilog=example)(with_settings(build, all_settings()))
    app.command(epilog="Example: headturn compact dataset --out dataset-compact")(compact)


def _print_result(result: Any, seconds: float, as_json: bool) -> None:
    manifest = result.manifest
    rate = manifest.detected_rows / manifest.rows
    twins = sum(part.rows for part in manifest.twins)
    facts = {
        "dataset": str(result.root),
        "rows": manifest.rows,
        **({"twins": twins} if twins else {}),
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
        f"check     headturn verify {shlex.quote(str(result.root))}",
    ]
    if twins:
        lines.insert(2, f"twins     {plural(twins, 'twin')} of rows; headturn ablate compares them")
    if manifest.configuration.get("dataset", {}).get("validation"):
        rows = dict.fromkeys(("train", "validation"), 0)
        for part in manifest.parts:
            rows[part.path.split("/")[1]] += part.rows
        said = ", ".join(f"{plural(count, 'row')} in {split}" for split, count in rows.items())
        lines.insert(2, f"splits    {said}")
    if result.skipped:
        lines.append(f"left out  {plural(len(result.skipped), 'head')}: see {result.root / 'manifest.json'}")
    if result.failed_units:
        lines.append(f"left out  {plural(result.failed_units, 'unit')}: see {result.root / 'failures.jsonl'}")
    for line in lines:
        say(line)
