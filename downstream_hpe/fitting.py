# SPDX-License-Identifier: MIT
"""From a dataset to a model folder.

A model folder holds tensor.safetensors (core, factors, manifolds, mean face), network.safetensors,
model.onnx (raw landmarks to pose), model.json (settings, data, results) and manifolds.png.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.evaluation.estimators import compare, estimators
from downstream_hpe.evaluation.reference import mean_face
from downstream_hpe.evaluation.scores import Evaluation, summary, within_bounds
from downstream_hpe.geometry.normalise import Normalisation, normalise
from downstream_hpe.geometry.rotation import ANGLES, rotation_from_angles
from downstream_hpe.manifold.cosines import MIN_SAMPLES, NARROWEST_DEG
from downstream_hpe.manifold.decomposition import PAPER_RANKS, Ranks, decompose
from downstream_hpe.manifold.plot import plot_manifolds
from downstream_hpe.manifold.tensor_model import TENSOR_FILE, TensorModel
from downstream_hpe.networks.confidence import Confidence, calibrate, level_faces
from downstream_hpe.networks.truncation import untruncated
from downstream_hpe.prediction.plausibility import FaceShapes
from downstream_hpe.prediction.predictor import MODEL_FILE
from downstream_hpe.tables.missing import Missing
from downstream_hpe.tables.pose_zero import common_zero
from downstream_hpe.tables.rows import Rows, read_rows
from downstream_hpe.tables.splits import split_subjects, subjects_by_split
from downstream_hpe.tables.tensor import Axes, open_tensor
from downstream_hpe.writing import writing

if TYPE_CHECKING:
    from downstream_hpe.networks.training import Progress
    from downstream_hpe.networks.weights import Weights

CARD_FILE = "model.json"
PLOT_FILE = "manifolds.png"
PARTIAL_EVERY = 3
"""One partial face of so many is learned from: exact ones are soon learned, and more of them make the network
take a detector's profiles for exact, too."""
LITTLE = 0.5
"""Of the error of the answer (0, 0, 0): who is off by more has learned too little."""


@dataclass(frozen=True)
class FitSettings:
    """recipe: "continuous" or "paper". extra: further datasets, at any poses, that only the networks
    learn from. calibrate: datasets that the confidence is calibrated on instead of the subjects held out;
    whoever was trained on is left out, and one that is named twice counts twice. partial: whether the
    networks learn from rows on which no face was found, too, from the exact landmarks that the camera sees.
    validation: share of subjects held out where no dataset has a validation split of its own; 0: none, and
    then there is no confidence either, unless calibrate says what it is to come from."""

    recipe: str = "continuous"
    extra: tuple[str, ...] = ()
    calibrate: tuple[str, ...] = ()
    ranks: Ranks = PAPER_RANKS
    missing: Missing = "fail"
    partial: bool = False
    normalisation: Normalisation = "rms"
    refinements: int = 2
    validation: float = 0.1
    epochs: int | None = None
    seed: int = 0
    expression: str | None = None
    threads: int = 2


@dataclass(frozen=True)
class Fitted:
    """What a fit gives: the model's card, and its errors on the subjects held out (none: empty)."""

    card: dict[str, Any]
    evaluations: list[Evaluation] = field(default_factory=list)


def fit(
    dataset: Path,
    folder: Path,
    settings: FitSettings,
    note: Callable[[str], None] = lambda text: None,
    progress: Progress | None = None,
) -> Fitted:
    """Decompose, fit manifolds, train, export, and evaluate on the subjects held out.

    note: called with one line whenever a stage is done. Run again after an interruption, training
    goes on where it stopped.

    Raises
    ------
    DataError, ModelError: as the stages it calls.
    """
    # Only a fit needs torch and onnx.
    import torch

    from downstream_hpe.networks.export import export_onnx
    from downstream_hpe.networks.recipe import recipe_named
    from downstream_hpe.networks.training import train
    from downstream_hpe.networks.weights import NETWORK_FILE, Weights

    recipe = recipe_named(settings.recipe, settings.epochs, settings.seed)
    if settings.extra and not recipe.continuous:
        raise UsageError("the paper's recipe learns from a grid alone; leave out --extra or its recipe")
    if settings.partial and not recipe.continuous:
        raise UsageError(
            "the paper's recipe learns from whole faces alone; leave out --partial or its recipe"
        )
    every = [dataset, *map(Path, settings.extra)]
    zero = common_zero([*every, *map(Path, settings.calibrate)])
    trained, held_out = _subjects(every, settings)
    datasets = [read_rows(path, partial=settings.partial) for path in every]
    rows = Rows.joined(datasets)
    face = mean_face(_of(rows, trained))
    usable = Rows.joined(untruncated(datasets, face)) if recipe.continuous else rows
    mine, theirs = _fewer_partial(_of(usable, trained)), _of(rows, held_out)
    # What a detector makes of a face is to be judged.
    theirs = theirs.take(theirs.complete)
    judges = _judges(settings.calibrate, trained, face) if settings.calibrate else _of(usable, held_out)
    judges = judges.take(judges.complete)
    model, card = _tensor_model(dataset, trained, face, settings, folder, note)
    if len(usable) < len(rows):
        note(
            f"{len(rows) - len(usable)} faces left out: near the end of their dataset, where another goes on"
        )
    parts = f" ({(~mine.complete).sum()} of them partial)" if settings.partial else ""
    note(f"{len(mine)} faces{parts} of {len(trained)} subjects; held out: {len(theirs)} of {len(held_out)}")

    torch.set_num_threads(settings.threads)
    network = train(mine, model, recipe, folder, progress)
    ranges = model.manifolds.range_deg
    weights = Weights(network, settings.normalisation, ranges, None, tuple(sorted(trained)), zero)
    if len(judges):
        weights = replace(weights, confidence=_confidence(weights, mine, judges))
        note(f"confidence calibrated on {len(judges)} faces of {len(set(judges.subjects))} subjects")
    with writing(folder):
        weights.save(folder / NETWORK_FILE)
        export_onnx(weights, folder / MODEL_FILE)
    card |= {
        "settings": asdict(settings),
        "recipe": asdict(recipe),
        "trained_subjects": sorted(trained),
        "held_out_subjects": sorted(held_out),
        "rows": len(mine),
        "range_deg": ranges.tolist(),
        "pose_zero": zero,
    }
    inside = theirs.take(within_bounds(theirs.ypr_deg))
    evaluations = compare(inside, estimators(folder)) if len(inside) else []
    if evaluations:
        card["held_out"] = [summary(e) for e in evaluations]
    for line in unlearnt(evaluations):
        note(line)
    with writing(folder):
        (folder / CARD_FILE).write_text(json.dumps(card, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return Fitted(card, evaluations)


def _fewer_partial(rows: Rows) -> Rows:
    return rows.take(rows.complete | (np.arange(len(rows)) % PARTIAL_EVERY == 0))


def _of(rows: Rows, subjects: set[str]) -> Rows:
    return rows.take(np.isin(rows.subjects, sorted(subjects)))


def _tensor_model(
    dataset: Path,
    trained: set[str],
    reference: np.ndarray,
    settings: FitSettings,
    folder: Path,
    note: Callable[[str], None],
) -> tuple[TensorModel, dict[str, Any]]:
    """Decomposition and manifolds of the grid, written to the folder; and their part of the card."""
    tensor = open_tensor(
        dataset,
        missing=settings.missing,
        normalisation=settings.normalisation,
        subjects=trained,
        expression=settings.expression,
        demands=partial(demands_of, settings.ranks),
    )
    with writing(folder):
        folder.mkdir(parents=True, exist_ok=True)
    note(f"tensor {' x '.join(map(str, tensor.shape))}; {tensor.report.text()}")

    def round_done(number: int, error: float) -> None:
        if number % 5 == 0:
            note(f"missing cells, round {number}: relative error {error:.5f}")

    fit = decompose(tensor, settings.ranks, refinements=settings.refinements, progress=round_done)
    shares = ", ".join(
        f"{angle} {energies[: settings.ranks[k]].sum():.2%}"
        for k, (angle, energies) in enumerate(zip(ANGLES, fit.energies[1:], strict=True), start=1)
    )
    note(f"relative error {fit.relative_error:.4f}; energy kept: {shares}")
    model = TensorModel.of(fit, tensor.axes_deg, reference, settings.normalisation)
    model.save(folder / TENSOR_FILE)
    plot_manifolds(fit, model.manifolds, tensor.axes_deg, folder / PLOT_FILE)
    note(f"manifolds: {folder / PLOT_FILE}")
    energies = zip(("identity", *ANGLES), fit.energies, strict=True)
    return model, {
        "cells_without_landmarks": len(tensor.report.cells),
        "relative_error": fit.relative_error,
        "energies": {axis: values[:6].tolist() for axis, values in energies},
    }


def demands_of(ranks: Ranks, heads: int, axes: Axes) -> list[str]:
    """What a grid lacks for ranks and curves, each with a way out."""
    lacking = []
    least = max(ranks[0], 2)
    if heads < least:
        fewer = f", or give --ranks {heads},{','.join(map(str, ranks[1:]))}" if heads > 1 else ""
        lacking.append(
            f"{heads} heads to learn from besides those held out, too few for identity rank {ranks[0]}, "
            f"expected at least {least}: build more heads{fewer}"
        )
    for name, axis, rank in zip(ANGLES, axes, ranks[1:], strict=True):
        least = max(rank, MIN_SAMPLES)
        if len(axis) < least:
            lacking.append(
                f"{len(axis)} {name} angles on the grid, expected at least {least}: "
                f"build with a finer step or a wider range of {name}"
            )
        elif np.ptp(axis) <= NARROWEST_DEG:
            lacking.append(
                f"{np.ptp(axis):g} degrees of {name} on the grid, expected more than {NARROWEST_DEG:.2g}: "
                f"build with a wider range of {name}"
            )
    return lacking


def unlearnt(evaluations: Sequence[Evaluation]) -> list[str]:
    """A line for what was learned and is hardly better on unseen faces than the answer (0, 0, 0)."""
    by_name = {e.name: e.mean_mae for e in evaluations}
    nothing = by_name.pop("constant zero", np.inf)
    return [
        f"warning: {name} is off by {mae:.2f} degrees on the subjects held out, where answering zero is by "
        f"{nothing:.2f}: it learned too little; give it more heads, poses or --epochs"
        for name, mae in by_name.items()
        if mae > LITTLE * nothing and not name.startswith("rigid fit")
    ]


def _judges(datasets: Sequence[str], trained: set[str], face: np.ndarray) -> Rows:
    """The rows of subjects that were not trained on. DataError: there are none."""
    rows = Rows.joined(untruncated([read_rows(path) for path in datasets], face))
    judges = rows.take(~np.isin(rows.subjects, sorted(trained)))
    if not len(judges):
        raise DataError(f"{', '.join(datasets)}: every subject is trained on; calibrate on others")
    return judges


def _confidence(weights: Weights, mine: Rows, theirs: Rows) -> Confidence:
    """Calibrated on faces that were not trained on, at all their poses."""
    import torch

    features = normalise(theirs.landmarks, weights.normalisation).reshape(len(theirs), -1)
    with torch.no_grad():
        ypr_deg = weights.network(torch.from_numpy(features.astype(np.float32))).numpy().astype(np.float64)
    rotation = rotation_from_angles(ypr_deg)
    faces = level_faces(mine.landmarks, mine.rotation, weights.normalisation)
    share = FaceShapes.load().share(theirs.landmarks.astype(np.float64))
    return calibrate(faces, weights.range_deg, features, ypr_deg, rotation, theirs.rotation, share)


def _subjects(datasets: Sequence[Path], settings: FitSettings) -> tuple[set[str], set[str]]:
    """Subjects to train on, and those held out, whichever datasets they are in."""
    splits: dict[str, set[str]] = {}
    for path in datasets:
        for split, subjects in subjects_by_split(path).items():
            splits.setdefault(split, set()).update(subjects)
    every = set().union(*splits.values())
    if "validation" in splits:
        held = splits["validation"]
    elif settings.validation:
        names = np.array(sorted(every))
        held = set(names[split_subjects(names, settings.validation, settings.seed)].tolist())
    else:
        held = set()
    return every - held, held
