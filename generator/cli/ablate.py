# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn ablate``: what each factor does to the detector, and to models."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.text import Text

from generator.cli.console import JsonFlag, err, out, say, shown
from generator.cli.reporter import TerminalReporter
from generator.limits import MAX_SEED
from generator.words import plural

if TYPE_CHECKING:
    from rich.table import Table

    from generator.dataset.ablate.ablation import Ablation, FactorEffects, Judged
    from generator.dataset.ablate.effects import Effect


def ablate(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="A dataset made by headturn build with --twins.")
    ],
    predictions: Annotated[
        list[Path] | None,
        typer.Option(
            help="Answers of a model: .csv or .parquet with sample_id, yaw_deg, pitch_deg, roll_deg, of "
            "rows and twins, or as downstream-hpe predict writes it; repeatable."
        ),
    ] = None,
    figures: Annotated[
        Path | None, typer.Option("--out", help="All figures as CSV; ablation.csv in the dataset if absent.")
    ] = None,
    seed: Annotated[int, typer.Option(min=0, max=MAX_SEED, help="Seed of the resampling.")] = 0,
    as_json: JsonFlag = False,
) -> None:
    """What each factor does to detection, landmarks and pose, from rows and their twins.

    In a pair one image is plain in the factor and the other is not; nothing else differs. Intervals hold
    95 % of 2000 resamplings of the identities.
    """
    from generator.dataset.ablate.ablation import ABLATION_FILE, ablate_dataset
    from generator.dataset.ablate.pairs import rows_to_read
    from generator.dataset.ablate.predictions import read_predictions
    from generator.dataset.format.files import write_anywhere

    models = [read_predictions(path) for path in predictions or ()]
    with TerminalReporter(err) as reporter:
        reporter.stage("reading rows and twins", rows_to_read(folder))
        found = ablate_dataset(folder, models, seed=seed, progress=reporter.advance)
    file = figures or folder / ABLATION_FILE
    write_anywhere(file, found.as_csv().encode())
    if as_json:
        typer.echo(json.dumps({**found.as_dict(), "table": str(file)}, indent=1))
        return
    table = _table(found)
    out.print(table)
    for line in _notes(found):
        say(line)
    say(f"table     {file}")


def _table(found: Ablation) -> Table:
    from rich.table import Table

    table = Table(
        title="With a factor, against the same image without it", title_justify="left", show_lines=True
    )
    for name in ("factor", "of", "pairs"):
        table.add_column(name, no_wrap=True)
    for name in ("found %", "landmarks %", "pose °", "yaw °", "pitch °", "roll °"):
        table.add_column(name, justify="right")
    for one in found.factors:
        for judged in one.judged:
            table.add_row(*_cells(one, judged))
    return table


def _cells(one: FactorEffects, judged: Judged) -> list[Text]:
    effects = {effect.measure: effect for effect in judged.effects}
    shown_effects = (effects.get(name) for name in ("found", "landmarks", "geodesic", "yaw", "pitch", "roll"))
    return [*map(shown, (one.factor, judged.estimator, one.pairs)), *map(_cell, shown_effects)]


def _cell(effect: Effect | None) -> Text:
    """Without the factor and with it, the change and its interval, a line each."""
    if effect is None:
        return shown("")
    lines = [shown(f"{_number(effect.plain)} → {_number(effect.varied)}"), shown(_number(effect.change, "+"))]
    if effect.is_sure:
        lines[1].stylize("bold")
    if not math.isnan(effect.low):
        lines.append(shown(f"[{_number(effect.low, '+')}, {_number(effect.high, '+')}]"))
    return Text("\n").join(lines)


def _number(value: float, sign: str = "") -> str:
    return "-" if math.isnan(value) else f"{value:{sign}.2f}"


def _notes(found: Ablation) -> list[str]:
    """What the table leaves out."""
    notes = [
        "found: share of all pairs; landmarks (of the eyes' distance) and pose errors: pairs in which both "
        "faces were found"
    ]
    for one in found.factors:
        for judged in one.judged:
            if judged.missed:
                notes.append(
                    f"{one.factor}, {judged.estimator}: no face in {judged.missed} of "
                    f"{plural(one.pairs, 'pair')}: {judged.found_plain} only with it, {judged.found_with} "
                    f"only without, {judged.found_neither} in both"
                )
        if one.not_made:
            notes.append(
                f"{one.factor}: {plural(one.not_made, 'pair')} left out: it could not be made for the head"
            )
        if one.identities == 1:
            notes.append(f"{one.factor}: of one identity, so there is no interval")
    return notes


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command(epilog="Example: headturn ablate dataset --predictions predictions.csv")(ablate)
