# SPDX-License-Identifier: MIT
"""What ``downstream-hpe evaluate`` does with its options."""

from __future__ import annotations

import json
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from downstream_hpe.cli.console import JsonFlag, note
from downstream_hpe.errors import UsageError


class LayoutName(str, Enum):
    """Choices of --format."""

    headturn = "headturn"
    aflw2000 = "aflw2000"
    biwi = "biwi"
    biwi_colour = "biwi-colour"
    biwi_npz = "biwi-npz"


def evaluate(
    model: Annotated[str, typer.Argument(help="A model folder, an .onnx file, or the name of a model.")],
    dataset: Annotated[Path, typer.Argument(help="A dataset; subjects the model has seen are left out.")],
    layout: Annotated[
        LayoutName, typer.Option("--format", help="headturn, or labelled photographs; these need mediapipe.")
    ] = LayoutName.headturn,
    split: Annotated[str | None, typer.Option(help="Only this split.")] = None,
    reference: Annotated[
        Path | None, typer.Option(help="Face of the rigid fit, .npz or .csv [468, 3].")
    ] = None,
    bounded: Annotated[
        bool, typer.Option("--bounded/--all", help="Only poses in the paper's bounds: 50, 40, 30.")
    ] = True,
    report: Annotated[Path | None, typer.Option("--out", help="Folder for tables and plots.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Errors of the model beside its baselines, per angle and per interval."""
    from downstream_hpe.evaluation import misses, scored_rows, scores
    from downstream_hpe.evaluation.estimators import compare, model_estimators
    from downstream_hpe.evaluation.reference import load_reference
    from downstream_hpe.evaluation.reliability import reliability
    from downstream_hpe.prediction.predictor import Predictor

    if report is not None and report.exists() and not report.is_dir():
        raise UsageError(f"{report}: --out takes a folder, and this is a file")
    predictor = Predictor.load(model)
    face = None if reference is None else load_reference(reference)
    every = model_estimators(model, predictor, face)
    if layout is LayoutName.headturn:
        measured = scored_rows.dataset_rows(predictor, dataset, split, note)
    else:
        measured = scored_rows.photograph_rows(predictor, dataset, layout.value, note)
        predictor.close()
    if bounded:
        measured = scored_rows.bounded(measured, dataset, note)
    rows, missed = measured.rows, misses.misses(measured.rows.ypr_deg, measured.missed_deg)
    undetected = len(measured.missed_deg)
    if undetected:
        note(f"no face found in {undetected} of {undetected + len(rows)} rows; they are not in the errors")
    found = compare(rows, every)
    tables = [scores.markdown(found)]
    said = predictor.from_landmarks(rows.landmarks).confidence
    if said is not None:
        tables.append(reliability(said, found[-1].geodesic_errors))
    if any(m.missed for m in missed):
        tables.append(misses.markdown(missed))
    if report is not None:
        from downstream_hpe.evaluation.plots import write_plots

        report.mkdir(parents=True, exist_ok=True)
        (report / "errors.md").write_text("\n".join(tables), encoding="utf-8")
        scores.write_csv(found, report / "errors.csv")
        misses.write_csv(missed, report / "misses.csv")
        write_plots(found, report)
        note(f"tables and plots: {report}")
    if as_json:
        counts = {"undetected": undetected, "damaged": measured.damaged}
        typer.echo(json.dumps([{**scores.summary(e), **counts} for e in found]))
    else:
        typer.echo("\n".join(tables))
    if measured.damaged:
        raise typer.Exit(3)
