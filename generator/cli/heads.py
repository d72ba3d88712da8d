# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn heads make`` and ``headturn heads list``."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from generator import registries
from generator.cli.console import EXIT_INCOMPLETE, JsonFlag, err, out, say, shown
from generator.cli.reporter import TerminalReporter
from generator.limits import MAX_WORKERS
from generator.plan.settings import PARAMETRIC, Heads
from generator.words import plural

FOLDER = "Folder for the heads: new, empty, or of heads made here; those of the same names are made anew."

heads_app = typer.Typer(help="Make heads, or look at a head source.", no_args_is_help=True)


@heads_app.command(
    "make", epilog="Example: headturn heads make --count 24 --seed 7 --expressions 3 --out heads"
)
def heads_make(
    folder: Annotated[Path, typer.Option("--out", help=FOLDER)],
    count: Annotated[int, typer.Option(help="How many identities.")] = Heads.count,
    seed: Annotated[int, typer.Option(help="Same seed, same bytes.")] = Heads.seed,
    expressions: Annotated[
        int, typer.Option(help="Sampled expressions each, besides the neutral face.")
    ] = Heads.sampled_expressions,
    source: Annotated[
        str,
        typer.Option(help='"parametric", from MakeHuman\'s CC0 data, or "ict:PATH", from your ICT-FaceKit.'),
    ] = PARAMETRIC,
    workers: Annotated[
        int | None, typer.Option(min=1, max=MAX_WORKERS, help="Processes; default one a core where it pays.")
    ] = None,
) -> None:
    """Make heads as OBJ folders."""
    from generator.heads.head import Maker, Wish

    name, _, argument = source.partition(":")
    maker: Maker = registries.HEAD_MAKERS.get(name)
    wish = Wish(argument, count, seed, expressions, workers, keep=False)
    with TerminalReporter(err) as reporter:
        reporter.stage("making heads", count)
        made = maker.make(folder, wish, reporter.advance)
    command = f"headturn build --heads {shlex.quote(str(folder))} --out dataset"
    say(f"{plural(len(made.subjects), 'head')} made in {folder}; build with: {command}")


@heads_app.command("list", epilog="Example: headturn heads list /data/facescape")
def heads_list(
    path: Annotated[Path, typer.Argument(help="A FaceScape download, a folder of meshes, or one mesh.")],
    shallow: Annotated[
        bool, typer.Option("--shallow", help="Look at names only; do not read the meshes.")
    ] = False,
    as_json: JsonFlag = False,
) -> None:
    """Show what a head source holds: subjects, expressions, vertices, texture, licence, problems."""
    from generator.execution.lanes.renderer import mesh_importer
    from generator.heads.describe import describe_source
    from generator.heads.source import find_heads

    source = find_heads(path)
    with mesh_importer() as importer:
        rows = describe_source(source, deep=not shallow, import_with_blender=importer)
    if as_json:
        typer.echo(json.dumps({"path": str(path), "kind": source.kind, "heads": rows}, indent=1))
    else:
        _print_heads(source.kind, path, rows)
    if any(row["skipped"] for row in rows):
        raise typer.Exit(EXIT_INCOMPLETE)


def _print_heads(kind: str, path: Path, rows: list[dict[str, Any]]) -> None:
    title = shown(f"{path}: {kind}, {plural(len(rows), 'head')}")
    table = Table(title=title, box=None, pad_edge=False, title_justify="left")
    columns = [c for c in (rows[0] if rows else {}) if c not in ("source", "path", "skipped")]
    for column in columns:
        table.add_column(column)
    for row in rows:
        row = {**row, "texture": "x".join(map(str, row["texture"])) if row["texture"] else None}
        table.add_row(*(shown(_cell(row[c])) for c in columns), style="dim" if row["skipped"] else None)
    out.print(table)


def _cell(value: object) -> str:
    if value is None or value == []:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (list, tuple)):
        return "; ".join(map(str, value))
    return str(value)


def register(app: typer.Typer) -> None:
    """Add the commands."""
    app.add_typer(heads_app, name="heads")
