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
from downstream_hpe.writing import writing


class LayoutName(str, Enum):
    """Choices of --format."""

    headturn = "headturn"
    aflw2000 = "aflw2000"
    biwi = "biwi"
    biwi_colour = "biwi-colour"
    biwi_npz = "biwi-npz"


class ProtocolName(str, Enum):
    """Choices of --protocol."""

    paper_bounds = "paper-bounds"
    up_to_99 = "99"
    fsanet_biwi = "fsanet-biwi"
    biwi_15677 = "biwi-15677"


def evaluate(
    model: Annotated[str, typer.Argument(help="A model folder, an .onnx file, or the name of a model.")],
    dataset: Annotated[Path, typer.Argument(help="A dataset; subjects the model has seen are left out.")],
    layout: Annotated[
        LayoutName, typer.Option("--format", help="headturn, or labelled photographs; these need a detector.")
    ] = LayoutName.headturn,
    split: Annotated[str | None, typer.Option(help="Only this split.")] = None,
    reference: Annotated[
        Path | None, typer.Option(help="Face of the rigid fit, .npz or .csv [468, 3].")
    ] = None,
    bounded: Annotated[
        bool, typer.Option("--bounded/--all", help="Only poses in the paper's bounds: 50, 40, 30.")
    ] = True,
    partial: Annotated[
        bool,
        typer.Option(
            "--partial", help="Score the rows without a face, by the exact landmarks that the camera sees."
        ),
    ] = False,
    protocol: Annotated[
        ProtocolName | None,
        typer.Option(help="Which labels count, by the papers' names."),
    ] = None,
    folds: Annotated[
        int,
        typer.Option(min=2, max=1000, help="Folds of subjects for the errors without a constant rotation."),
    ] = 5,
    detector: Annotated[
        str | None, typer.Option(help="Detector of faces in photographs, as for predict.")
    ] = None,
    report: Annotated[Path | None, typer.Option("--out", help="Folder for tables and plots.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Errors of the model beside its baselines, per angle and per interval; raw and without a constant."""
    from downstream_hpe.evaluation import constant, misses, scored_rows, scores
    from downstream_hpe.evaluation.estimators import compare, model_estimators, reference_face
    from downstream_hpe.evaluation.label_frame import label_frames
    from downstream_hpe.evaluation.protocols import check_protocol, under
    from downstream_hpe.evaluation.reference import load_reference
    from downstream_hpe.evaluation.reliability import reliability
    from downstream_hpe.prediction.predictor import Predictor

    if report is not None and report.exists() and not report.is_dir():
        raise UsageError(f"{report}: --out takes a folder, and this is a file")
    if protocol is not None and not bounded:
        raise UsageError("--all scores every label, and --protocol says which; give one of them")
    if protocol is not None:
        check_protocol(protocol.value, layout.value)
    if detector is not None and layout is LayoutName.headturn:
        raise UsageError("--detector looks at photographs; the rows of a dataset have their landmarks")
    if partial and layout is not LayoutName.headturn:
        raise UsageError("--partial needs exact landmarks, which photographs have none of; leave it out")
    predictor = Predictor.load(model, detector=detector)
    face = None if reference is None else load_reference(reference)
    every = model_estimators(model, predictor, face)
    if layout is LayoutName.headturn:
        measured = scored_rows.dataset_rows(predictor, dataset, split, note, partial)
    else:
        measured = scored_rows.photograph_rows(predictor, dataset, layout.value, note)
        predictor.close()
    if bounded:
        name = (protocol or ProtocolName.paper_bounds).value
        measured = under(name, layout.value, measured, dataset, note)
    rows, missed = measured.rows, misses.misses(measured.rows.ypr_deg, measured.missed_deg)
    undetected = len(measured.missed_deg)
    if undetected:
        note(f"no face found in {undetected} of {undetected + len(rows)} rows; they are not in the errors")
    found = compare(rows, every)
    framed = label_frames(found, measured, reference_face(model, face), folds)
    tables = [scores.markdown(found)]
    if framed:
        tables.append(constant.markdown(framed))
    said = predictor.from_landmarks(rows.landmarks).confidence
    if said is not None:
        tables.append(reliability(said, found[-1].geodesic_errors))
    if any(m.missed for m in missed):
        tables.append(misses.markdown(missed))
    if report is not None:
        from downstream_hpe.evaluation.plots import write_plots

        with writing(report):
            report.mkdir(parents=True, exist_ok=True)
            (report / "errors.md").write_text("\n".join(tables), encoding="utf-8")
            scores.write_csv(found, report / "errors.csv")
            misses.write_csv(missed, report / "misses.csv")
            write_plots(found, report)
        note(f"tables and plots: {report}")
    if as_json:
        counts = {"undetected": undetected, "damaged": measured.damaged}
        constants = {e.name: constant.summary(c) for e, c in framed}
        own = [e for e, _ in framed[len(found) :]]
        typer.echo(
            json.dumps([{**scores.summary(e), **constants.get(e.name, {}), **counts} for e in [*found, *own]])
        )
    else:
        typer.echo("\n".join(tables))
    if measured.damaged:
        raise typer.Exit(3)
