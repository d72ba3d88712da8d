# SPDX-License-Identifier: MIT
"""What ``downstream-hpe fit`` does with its options."""

from __future__ import annotations

import json
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from downstream_hpe.cli.console import JsonFlag, note, progress, say
from downstream_hpe.errors import UsageError


class RecipeName(str, Enum):
    """Choices of --recipe."""

    continuous = "continuous"
    paper = "paper"


class MissingName(str, Enum):
    """Choices of --missing."""

    fail = "fail"
    keep = "keep"
    exact = "exact"
    frontal = "frontal"


class HolesName(str, Enum):
    """What --missing was called before, and its words."""

    refuse = "refuse"
    mask = "mask"
    exact = "exact"
    rotate = "rotate"


class NormalisationName(str, Enum):
    """Choices of --normalisation."""

    rms = "rms"
    eyes = "eyes"


def fit(
    dataset: Annotated[Path, typer.Argument(help="A dataset made by headturn build, on a grid.")],
    model: Annotated[Path, typer.Option("--out", help="Folder of the model.")],
    missing: Annotated[
        MissingName,
        typer.Option(
            help="Cells without a face: fail, keep (the fit leaves them out), exact or frontal (the paper's)."
        ),
    ] = MissingName.fail,
    holes: Annotated[HolesName | None, typer.Option(hidden=True)] = None,
    extra: Annotated[
        list[Path] | None,
        typer.Option(help="A further dataset, at any poses, for the networks alone; repeatable."),
    ] = None,
    calibrate: Annotated[
        list[Path] | None,
        typer.Option(
            help="A dataset to calibrate the confidence on, instead of the subjects held out; repeatable."
        ),
    ] = None,
    partial: Annotated[
        bool,
        typer.Option(
            "--partial",
            help="Learn from rows without a face, too: from the exact landmarks that the camera sees.",
        ),
    ] = False,
    recipe: Annotated[
        RecipeName, typer.Option(help="continuous: this program's. paper: the paper's.")
    ] = RecipeName.continuous,
    ranks: Annotated[str, typer.Option(help="ID,YAW,PITCH,ROLL of the decomposition.")] = "5,3,3,3",
    normalisation: Annotated[
        NormalisationName, typer.Option(help="rms: the paper's. eyes: its published code's.")
    ] = NormalisationName.rms,
    refinements: Annotated[int, typer.Option(min=0, max=1000, help="Rounds of orthogonal iteration.")] = 2,
    validation: Annotated[
        float, typer.Option(min=0, max=0.9, help="Share of subjects held out, if the dataset holds out none.")
    ] = 0.1,
    expression: Annotated[str | None, typer.Option(help="Only this expression in the tensor.")] = None,
    epochs: Annotated[int | None, typer.Option(min=1, max=10**6, help="Training epochs.")] = None,
    seed: Annotated[int, typer.Option(min=0, max=2**63 - 1, help="Seed of weights, order and noise.")] = 0,
    threads: Annotated[int, typer.Option(min=1, max=4096, help="Threads of the training.")] = 2,
    as_json: JsonFlag = False,
) -> None:
    """Decompose the tensor, fit the manifolds, train the networks, export, evaluate.

    Run it again to continue a training that was interrupted.
    """
    from downstream_hpe.evaluation.scores import markdown
    from downstream_hpe.fitting import FitSettings
    from downstream_hpe.fitting import fit as run_fit

    settings = FitSettings(
        recipe=recipe.value,
        extra=tuple(map(str, extra or ())),
        calibrate=tuple(map(str, calibrate or ())),
        partial=partial,
        ranks=_ranks(ranks),
        missing=_missing(missing, holes).value,
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
    say(f"model     {model}")


def _missing(missing: MissingName, holes: HolesName | None) -> MissingName:
    if holes is None:
        return missing
    if missing is not MissingName.fail:
        raise UsageError("--holes is the old name of --missing; give --missing alone")
    return {
        HolesName.refuse: MissingName.fail,
        HolesName.mask: MissingName.keep,
        HolesName.exact: MissingName.exact,
        HolesName.rotate: MissingName.frontal,
    }[holes]


def _is_rank(word: str) -> bool:
    return word.isdecimal() and word.isascii() and len(word) <= 4 and int(word) > 0


def _ranks(text: str) -> tuple[int, int, int, int]:
    words = text.split(",")
    if len(words) != 4 or not all(_is_rank(word.strip()) for word in words):
        raise UsageError(f"--ranks {text!r}: expected four positive numbers, such as 5,3,3,3")
    identity, yaw, pitch, roll = map(int, words)
    if (yaw, pitch, roll) != (3, 3, 3):
        raise UsageError(
            f"--ranks {text!r}: the networks take three components of each angle; only ID is free"
        )
    return identity, yaw, pitch, roll
