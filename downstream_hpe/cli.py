# SPDX-License-Identifier: MIT
"""The ``downstream-hpe`` command.

Exit codes: 0 done, 1 failed, 2 wrong use, 3 finished with something left out, 130 stopped.
"""

from __future__ import annotations

import contextlib
import json
import time
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from downstream_hpe.console import note, one_line_errors, progress
from downstream_hpe.errors import DataError, UsageError

app = typer.Typer(
    help="Learn pose manifolds from Headturn's tables and estimate head pose.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

JsonFlag = Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")]


class RecipeName(str, Enum):
    """Choices of --recipe."""

    continuous = "continuous"
    paper = "paper"


class HolesName(str, Enum):
    """Choices of --holes."""

    refuse = "refuse"
    mask = "mask"
    exact = "exact"
    rotate = "rotate"


class LayoutName(str, Enum):
    """Choices of --format."""

    headturn = "headturn"
    aflw2000 = "aflw2000"
    biwi = "biwi"
    biwi_colour = "biwi-colour"
    biwi_npz = "biwi-npz"


class NormalisationName(str, Enum):
    """Choices of --normalisation."""

    rms = "rms"
    eyes = "eyes"


@app.command(epilog="Example: downstream-hpe fit dataset --out model --holes mask")
def fit(
    dataset: Annotated[Path, typer.Argument(help="A dataset made by headturn build, on a grid.")],
    model: Annotated[Path, typer.Option("--out", help="Folder of the model.")],
    holes: Annotated[
        HolesName, typer.Option(help="Cells without a detected face: refuse, mask, exact or rotate.")
    ] = HolesName.refuse,
    extra: Annotated[
        list[Path] | None,
        typer.Option(help="A further dataset, at any poses, for the networks alone; repeatable."),
    ] = None,
    recipe: Annotated[
        RecipeName, typer.Option(help="continuous: this program's. paper: the paper's.")
    ] = RecipeName.continuous,
    ranks: Annotated[str, typer.Option(help="ID,YAW,PITCH,ROLL of the decomposition.")] = "5,3,3,3",
    normalisation: Annotated[
        NormalisationName, typer.Option(help="rms: the paper's. eyes: its published code's.")
    ] = NormalisationName.rms,
    refinements: Annotated[int, typer.Option(min=0, help="Rounds of orthogonal iteration.")] = 2,
    validation: Annotated[
        float, typer.Option(min=0, max=0.9, help="Share of subjects held out, if the dataset holds out none.")
    ] = 0.1,
    expression: Annotated[str | None, typer.Option(help="Only this expression in the tensor.")] = None,
    epochs: Annotated[int | None, typer.Option(min=1, help="Training epochs.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of weights, order and noise.")] = 0,
    threads: Annotated[int, typer.Option(min=1, help="Threads of the training.")] = 2,
    as_json: JsonFlag = False,
) -> None:
    """Decompose the tensor, fit the manifolds, train the networks, export, evaluate.

    Run it again to continue a training that was interrupted.
    """
    from downstream_hpe.evaluation import markdown
    from downstream_hpe.fitting import FitSettings
    from downstream_hpe.fitting import fit as run_fit

    settings = FitSettings(
        recipe=recipe.value,
        extra=tuple(map(str, extra or ())),
        ranks=_ranks(ranks),
        holes=holes.value,
        normalisation=normalisation.value,
        refinements=refinements,
        validation=validation,
        epochs=epochs,
        seed=seed,
        expression=expression,
        threads=threads,
    )
    with progress() as bar:
        task = bar.add_task("training", total=None, loss="")

        def advance(done: int, total: int, loss: float) -> None:
            bar.update(task, completed=done, total=total, loss=f"loss {loss:.4f}")

        fitted = run_fit(dataset, model, settings, note, advance)
    if as_json:
        typer.echo(json.dumps({"model": str(model), **fitted.card}, sort_keys=True))
        return
    if fitted.evaluations:
        typer.echo(markdown(fitted.evaluations))
    typer.echo(f"model     {model}")


@app.command(epilog="Example: downstream-hpe evaluate model other_heads --out report")
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
    from downstream_hpe import evaluation as ev
    from downstream_hpe import measuring, misses
    from downstream_hpe.confidence import reliability
    from downstream_hpe.fitting import compare, summary
    from downstream_hpe.predictor import Predictor
    from downstream_hpe.reference import load_reference

    if report is not None and report.exists() and not report.is_dir():
        raise UsageError(f"{report}: --out takes a folder, and this is a file")
    predictor = Predictor.load(model)
    face = None if reference is None else load_reference(reference)
    every = measuring.model_estimators(model, predictor, face)
    if layout is LayoutName.headturn:
        measured = measuring.dataset_rows(predictor, dataset, split, note)
    else:
        measured = measuring.photograph_rows(predictor, dataset, layout.value, note)
        predictor.close()
    if bounded:
        measured = measuring.bounded(measured, dataset, note)
    rows, missed = measured.rows, misses.misses(measured.rows.ypr_deg, measured.missed_deg)
    undetected = len(measured.missed_deg)
    if undetected:
        note(f"no face found in {undetected} of {undetected + len(rows)} rows; they are not in the errors")
    found = compare(rows, every)
    tables = [ev.markdown(found)]
    said = predictor.from_landmarks(rows.landmarks).confidence
    if said is not None:
        tables.append(reliability(said, found[-1].geodesic_errors))
    if any(m.missed for m in missed):
        tables.append(misses.markdown(missed))
    if report is not None:
        from downstream_hpe.plots import write_plots

        report.mkdir(parents=True, exist_ok=True)
        (report / "errors.md").write_text("\n".join(tables), encoding="utf-8")
        ev.write_csv(found, report / "errors.csv")
        misses.write_csv(missed, report / "misses.csv")
        write_plots(found, report)
        note(f"tables and plots: {report}")
    if as_json:
        counts = {"undetected": undetected, "damaged": measured.damaged}
        typer.echo(json.dumps([{**summary(e), **counts} for e in found]))
    else:
        typer.echo("\n".join(tables))
    if measured.damaged:
        raise typer.Exit(3)


@app.command(epilog="Example: downstream-hpe predict photo.jpg --draw drawn")
def predict(
    inputs: Annotated[list[str], typer.Argument(help="Pictures, videos, folders of them, webcam:0.")],
    model: Annotated[
        str, typer.Option(help="The name of a model, a model folder, or an .onnx file.")
    ] = "headturn",
    table: Annotated[Path | None, typer.Option("--out", help="Write a .csv or .parquet file.")] = None,
    drawn: Annotated[
        Path | None,
        typer.Option("--draw", help="Folder for copies with axes and angles; of one input a file, too."),
    ] = None,
    faces: Annotated[int, typer.Option(min=1, help="At most so many faces a picture or frame.")] = 1,
    smooth: Annotated[bool, typer.Option(help="One-euro filter on video.")] = False,
    frames: Annotated[int | None, typer.Option(min=1, help="Stop a video after so many frames.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Head pose of the faces in pictures, videos and webcams; Ctrl-C ends a webcam."""
    from downstream_hpe.inputs import find_sources
    from downstream_hpe.predicting import Options, predictions
    from downstream_hpe.predictor import Predictor
    from downstream_hpe.records import RecordWriter, text

    left_out: list[str] = []

    def leave_out(line: str) -> None:
        left_out.append(line)
        if alone and not images:
            raise DataError(line)
        note(line)

    alone, images, with_face = False, 0, 0
    every = find_sources(inputs, drawn, leave_out)
    alone = len(every) == 1
    predictor = Predictor.load(model)
    options = Options(faces, smooth, frames)
    last, stopped = None, False
    began = ended = 0.0
    with contextlib.ExitStack() as stack:
        stack.callback(predictor.close)
        writer = None if table is None else stack.enter_context(RecordWriter(table))
        rows = stack.enter_context(contextlib.closing(predictions(every, predictor, options, leave_out)))
        try:
            for row in rows:
                if (row["input"], row["frame"]) != last:
                    images += 1
                    with_face += row["found"]
                    ended = time.monotonic()
                    began = began or ended
                    last = (row["input"], row["frame"])
                if writer is not None:
                    writer.add(row)
                typer.echo(json.dumps(row) if as_json else text(row, faces > 1))
        except KeyboardInterrupt:
            stopped = True
    # From the first to the last, without the start of the detector.
    rate = f", {(images - 1) / (ended - began):.1f} a second" if images > 1 else ""
    if images:
        note(f"a face in {with_face} of {images} pictures and frames{rate}")
        if drawn is not None:
            note(f"drawn: {drawn if len(every) > 1 else every[0].copy}")
    if stopped and not any(isinstance(source.path, int) for source in every):
        raise typer.Exit(130)
    if not images:
        raise DataError(f"nothing could be read of {len(every)} inputs")
    if not with_face:
        raise DataError("no face found")
    if left_out:
        raise typer.Exit(3)


@app.command(epilog="Example: downstream-hpe export model --onnx pose.onnx --weights pose.safetensors")
def export(
    model: Annotated[Path, typer.Argument(help="A model folder of downstream-hpe fit.")],
    onnx: Annotated[Path | None, typer.Option(help="The graph from raw landmarks to pose.")] = None,
    weights: Annotated[Path | None, typer.Option(help="The network's weights, safetensors.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Write a trained model as files that need nothing of this program."""
    from downstream_hpe.export import export_onnx
    from downstream_hpe.fitting import NETWORK_FILE
    from downstream_hpe.networks import Weights

    if onnx is None and weights is None:
        raise UsageError("nothing to write; give --onnx FILE, --weights FILE or both")
    trained = Weights.load(model / NETWORK_FILE)
    written: list[Path] = []
    for path, write in ((onnx, lambda file: export_onnx(trained, file)), (weights, trained.save)):
        if path is not None:
            write(path)
            written.append(path)
    if as_json:
        typer.echo(json.dumps([{"file": str(path), "bytes": path.stat().st_size} for path in written]))
        return
    for path in written:
        typer.echo(f"{path}: {path.stat().st_size / 1e6:.1f} MB")


def _ranks(text: str) -> tuple[int, int, int, int]:
    words = text.split(",")
    if len(words) != 4 or not all(word.strip().isdigit() and int(word) > 0 for word in words):
        raise UsageError(f"--ranks {text!r}: expected four positive numbers, such as 5,3,3,3")
    identity, yaw, pitch, roll = map(int, words)
    if (yaw, pitch, roll) != (3, 3, 3):
        raise UsageError(
            f"--ranks {text!r}: the networks take three components of each angle; only ID is free"
        )
    return identity, yaw, pitch, roll


def main() -> None:
    """Entry point of the console script."""
    with one_line_errors():
        app()


if __name__ == "__main__":
    main()
