# SPDX-License-Identifier: MIT
"""From a dataset to a model folder, and from a model to a table of errors.

A model folder holds tensor.safetensors (core, factors, manifolds, mean face), network.safetensors,
model.onnx (raw landmarks to pose), model.json (settings, data, results) and manifolds.png.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from downstream_hpe.decomposition import PAPER_RANKS, Ranks, decompose
from downstream_hpe.errors import DataError, ModelError
from downstream_hpe.evaluation import (
    ANGLES,
    Estimator,
    Evaluation,
    constant_zero,
    evaluate,
    rigid_fit,
    split_subjects,
)
from downstream_hpe.manifold import plot_manifolds
from downstream_hpe.model import Progress, TensorModel
from downstream_hpe.normalise import Normalisation
from downstream_hpe.predictor import MODEL_FILE, Predictor
from downstream_hpe.reference import mean_face
from downstream_hpe.tables import Rows, read_rows, subjects_by_split
from downstream_hpe.tensor import Holes, open_tensor

TENSOR_FILE = "tensor.safetensors"
NETWORK_FILE = "network.safetensors"
CARD_FILE = "model.json"
PLOT_FILE = "manifolds.png"


@dataclass(frozen=True)
class FitSettings:
    """recipe: "continuous" or "paper". validation: share of subjects held out where the dataset has
    no validation split of its own; 0: none."""

    recipe: str = "continuous"
    ranks: Ranks = PAPER_RANKS
    holes: Holes = "refuse"
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

    from downstream_hpe.export import export_onnx
    from downstream_hpe.networks import Weights
    from downstream_hpe.training import recipe_named, train

    recipe = recipe_named(settings.recipe, settings.epochs, settings.seed)
    trained, held_out = _subjects(dataset, settings)
    tensor = open_tensor(
        dataset,
        holes=settings.holes,
        normalisation=settings.normalisation,
        subjects=trained,
        expression=settings.expression,
    )
    note(f"tensor {' x '.join(map(str, tensor.shape))}; {tensor.report.text()}")

    def round_done(number: int, error: float) -> None:
        if number % 5 == 0:
            note(f"missing cells, round {number}: relative error {error:.5f}")

    decomposition = decompose(tensor, settings.ranks, refinements=settings.refinements, progress=round_done)
    shares = ", ".join(
        f"{angle} {energies[: settings.ranks[k]].sum():.2%}"
        for k, (angle, energies) in enumerate(zip(ANGLES, decomposition.energies[1:], strict=True), start=1)
    )
    note(f"relative error {decomposition.relative_error:.4f}; energy kept: {shares}")
    rows = read_rows(dataset)
    mine = np.isin(rows.subjects, sorted(trained))
    model = TensorModel.of(decomposition, tensor.axes_deg, mean_face(rows.take(mine)), settings.normalisation)
    folder.mkdir(parents=True, exist_ok=True)
    model.save(folder / TENSOR_FILE)
    plot_manifolds(decomposition, model.manifolds, tensor.axes_deg, folder / PLOT_FILE)
    note(f"manifolds: {folder / PLOT_FILE}")

    torch.set_num_threads(settings.threads)
    network = train(rows.take(mine), model, recipe, folder, progress)
    card: dict[str, Any] = {
        "settings": asdict(settings),
        "recipe": asdict(recipe),
        "trained_subjects": sorted(trained),
        "held_out_subjects": sorted(held_out),
        "rows": int(mine.sum()),
        "cells_without_landmarks": len(tensor.report.cells),
        "relative_error": decomposition.relative_error,
        "energies": {
            a: e[:6].tolist() for a, e in zip(("identity", *ANGLES), decomposition.energies, strict=True)
        },
        "range_deg": model.manifolds.range_deg.tolist(),
    }
    weights = Weights(network, settings.normalisation, model.manifolds.range_deg)
    weights.save(folder / NETWORK_FILE)
    export_onnx(weights, folder / MODEL_FILE)
    evaluations: list[Evaluation] = []
    theirs = np.isin(rows.subjects, sorted(held_out))
    if theirs.any():
        evaluations = compare(rows.take(theirs), estimators(folder))
        card["held_out"] = [summary(e) for e in evaluations]
    (folder / CARD_FILE).write_text(json.dumps(card, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    return Fitted(card, evaluations)


def estimators(folder: Path, reference: np.ndarray | None = None) -> dict[str, Estimator]:
    """The baselines and the model of a folder, by name.

    reference: float [468, 3], frame C, for the rigid fit; None: the mean face of the training set.
    """
    model = TensorModel.load(folder / TENSOR_FILE)
    predictor = Predictor.load(folder)
    reconstruction = model.estimator()
    face, of = (model.reference, "mean face") if reference is None else (reference, "reference face")
    return {
        "constant zero": constant_zero,
        f"rigid fit to {of}": rigid_fit(face),
        "reconstruction": lambda landmarks: reconstruction.from_landmarks(landmarks).ypr_deg,
        "encoder + heads": lambda landmarks: predictor.from_landmarks(landmarks).ypr_deg,
    }


def compare(rows: Rows, every: dict[str, Estimator]) -> list[Evaluation]:
    """Every estimator on the same rows."""
    return [evaluate(name, estimate(rows.landmarks), rows.rotation) for name, estimate in every.items()]


def unseen_rows(folder: Path, dataset: Path, split: str | None) -> Rows:
    """Rows of a dataset whose subjects the model was not trained on.

    Raises
    ------
    ModelError: no card in the folder. DataError: no such rows.
    """
    file = folder / CARD_FILE
    try:
        trained = json.loads(file.read_text(encoding="utf-8"))["trained_subjects"]
    except (OSError, json.JSONDecodeError, KeyError) as error:
        raise ModelError(
            f"{file}: not the card of a model; expected a folder of downstream-hpe fit"
        ) from error
    rows = read_rows(dataset, split)
    unseen = ~np.isin(rows.subjects, trained)
    if not unseen.any():
        raise DataError(f"{dataset}: the model was trained on every subject in it; give other heads")
    return rows.take(unseen)


def summary(e: Evaluation) -> dict[str, Any]:
    """The overall numbers of one estimator."""
    mae = dict(zip(ANGLES, e.mae, strict=True))
    return {
        "estimator": e.name,
        "rows": e.count,
        **mae,
        "mae": e.mean_mae,
        "maev": e.maev,
        "geodesic": e.geodesic,
    }


def _subjects(dataset: Path, settings: FitSettings) -> tuple[set[str], set[str]]:
    """Subjects to train on, and those held out."""
    splits = subjects_by_split(dataset)
    every = set().union(*splits.values())
    if "validation" in splits:
        held = splits["validation"]
    elif settings.validation:
        names = np.array(sorted(every))
        held = set(names[split_subjects(names, settings.validation, settings.seed)].tolist())
    else:
        held = set()
    return every - held, held
