# SPDX-License-Identifier: MIT
"""The ``downstream-hpe`` command.

Exit codes: 0 done, 1 failed, 2 wrong use.
"""

from __future__ import annotations

import contextlib
import csv
import json
import sys
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

from downstream_hpe.errors import DataError, HpeError, UsageError

app = typer.Typer(
    help="Learn pose manifolds from Headturn's tables and estimate head pose.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
out = Console()
err = Console(stderr=True)

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
    with _progress() as bar:
        task = bar.add_task("training", total=None, loss="")

        def advance(done: int, total: int, loss: float) -> None:
            bar.update(task, completed=done, total=total, loss=f"loss {loss:.4f}")

        fitted = run_fit(dataset, model, settings, _note, advance)
    if as_json:
        typer.echo(json.dumps({"model": str(model), **fitted.card}, sort_keys=True))
        return
    if fitted.evaluations:
        typer.echo(markdown(fitted.evaluations))
    typer.echo(f"model     {model}")


@app.command(epilog="Example: downstream-hpe evaluate model other_heads --out report")
def evaluate(
    model: Annotated[Path, typer.Argument(help="A model folder of downstream-hpe fit.")],
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
    from downstream_hpe.fitting import compare, estimators, summary, unseen_rows
    from downstream_hpe.photographs import FORMATS, detected_rows
    from downstream_hpe.predictor import Predictor
    from downstream_hpe.reference import load_reference

    face = None if reference is None else load_reference(reference)
    every = estimators(model, face)
    if layout is LayoutName.headturn:
        rows = unseen_rows(model, dataset, split)
    else:
        predictor = Predictor.load(model)
        rows = detected_rows(FORMATS[layout.value](dataset), predictor.landmarks)
        predictor.close()
    if rows.undetected:
        _note(f"no face found in {rows.undetected} of {rows.undetected + len(rows)} pictures")
    if bounded:
        inside = ev.within_bounds(rows.ypr_deg)
        if not inside.any():
            raise DataError(f"{dataset}: no pose within 50, 40, 30 degrees; use --all")
        if not inside.all():
            _note(f"{int((~inside).sum())} rows outside 50, 40, 30 degrees left out")
        rows = rows.take(inside)
    found = compare(rows, every)
    if report is not None:
        report.mkdir(parents=True, exist_ok=True)
        (report / "errors.md").write_text(ev.markdown(found), encoding="utf-8")
        ev.write_csv(found, report / "errors.csv")
        ev.plot_intervals(found, report / "error_by_interval.png")
        ev.plot_distribution(found, report / "error_distribution.png")
        _note(f"tables and plots: {report}")
    typer.echo(json.dumps([summary(e) for e in found]) if as_json else ev.markdown(found))


@app.command(epilog="Example: downstream-hpe predict photo.jpg --model model --draw drawn")
def predict(
    inputs: Annotated[list[str], typer.Argument(help="Pictures, folders of them, videos, webcam:0.")],
    model: Annotated[Path, typer.Option(help="A model folder, or an exported .onnx file.")],
    table: Annotated[Path | None, typer.Option("--out", help="Write a .csv file.")] = None,
    drawn: Annotated[
        Path | None, typer.Option("--draw", help="Folder for pictures and videos with the axes.")
    ] = None,
    smooth: Annotated[bool, typer.Option(help="One-euro filter on video.")] = False,
    frames: Annotated[int | None, typer.Option(min=1, help="Stop a video after so many frames.")] = None,
    as_json: JsonFlag = False,
) -> None:
    """Head pose of the most prominent face of each picture or frame."""
    from downstream_hpe.predicting import COLUMNS, predictions, sources
    from downstream_hpe.predictor import Predictor

    every = sources(inputs)
    predictor = Predictor.load(model)
    found = count = 0
    with contextlib.ExitStack() as stack:
        stack.callback(predictor.close)
        writer = None
        if table is not None:
            stream = stack.enter_context(table.open("w", newline="", encoding="utf-8"))
            writer = csv.DictWriter(stream, COLUMNS, lineterminator="\n")
            writer.writeheader()
        for record in predictions(every, predictor, drawn, smooth=smooth, frames=frames):
            count += 1
            found += record["found"]
            if writer is not None:
                writer.writerow(record)
            if as_json:
                typer.echo(json.dumps(record))
            else:
                typer.echo(_pose_line(record))
    if not found:
        raise DataError(f"no face found in {count} pictures")


def _pose_line(record: dict[str, Any]) -> str:
    where = record["input"] + (f" {record['time_s']:.2f} s" if record["frame"] is not None else "")
    if not record["found"]:
        return f"{where}: no face found"
    angles = (f"{name} {record[f'{name}_deg']:.1f}" for name in ("yaw", "pitch", "roll"))
    return f"{where}: {', '.join(angles)}"


@app.command(epilog="Example: downstream-hpe export model --onnx pose.onnx --weights pose.safetensors")
def export(
    model: Annotated[Path, typer.Argument(help="A model folder of downstream-hpe fit.")],
    onnx: Annotated[Path | None, typer.Option(help="The graph from raw landmarks to pose.")] = None,
    weights: Annotated[Path | None, typer.Option(help="The network's weights, safetensors.")] = None,
) -> None:
    """Write a trained model as files that need nothing of this program."""
    from downstream_hpe.export import export_onnx
    from downstream_hpe.fitting import NETWORK_FILE
    from downstream_hpe.networks import Weights

    if onnx is None and weights is None:
        raise UsageError("nothing to write; give --onnx FILE, --weights FILE or both")
    trained = Weights.load(model / NETWORK_FILE)
    if onnx is not None:
        export_onnx(trained, onnx)
        typer.echo(f"{onnx}: {onnx.stat().st_size / 1e6:.1f} MB")
    if weights is not None:
        trained.save(weights)
        typer.echo(f"{weights}: {weights.stat().st_size / 1e6:.1f} MB")


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


def _note(text: str) -> None:
    err.print(text, highlight=False, markup=False, soft_wrap=True)


def _progress() -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[loss]}"),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=err,
        disable=not err.is_terminal,
    )


@contextlib.contextmanager
def _one_line_errors() -> Iterator[None]:
    try:
        yield
    except HpeError as error:
        err.print(f"downstream-hpe: {error}", style="red", highlight=False, markup=False, soft_wrap=True)
        sys.exit(error.exit_code)
    except ModuleNotFoundError as error:
        # The learning side is an extra of the distribution.
        if error.name not in ("torch", "onnx", "onnxruntime", "safetensors"):
            raise
        _note(f"downstream-hpe: {error.name} is not installed: pip install 'headturn[hpe]'")
        sys.exit(1)
    except KeyboardInterrupt:
        _note("downstream-hpe: stopped; run the same command again to continue")
        sys.exit(130)


def main() -> None:
    """Entry point of the console script."""
    with _one_line_errors():
        app()


if __name__ == "__main__":
    main()
