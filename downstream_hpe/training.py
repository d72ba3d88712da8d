# SPDX-License-Identifier: MIT
"""Training of the encoder and the heads: resumable, and the same for the same seed.

Two recipes share one loop. `paper`: the encoder learns the rows of A^(y), A^(p), A^(r) of each grid
pose, and each head learns its angle from points of its cosine curves. `continuous`: any pose, its
targets from the curves; faces of other people through other lenses (augment.py); a loss on the
rotation that encoder and heads give together; and the average of the weights over the last steps.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn
from torch.optim.swa_utils import AveragedModel

from downstream_hpe.augment import NONE, Disturbances, disturbed, levelled, shapes_of
from downstream_hpe.errors import ModelError, UsageError
from downstream_hpe.model import Progress, TensorModel, packed, unpacked
from downstream_hpe.networks import HEAD_LAYERS, PAPER_LAYERS, PoseNetwork, rotation_of
from downstream_hpe.normalise import normalise
from downstream_hpe.rotation import angles_from_rotation
from downstream_hpe.tables import Rows

CHECKPOINT = "checkpoint.safetensors"
CHECKPOINT_FORMAT = "downstream-hpe checkpoint 2"
CURVE_STEP_DEG = 0.1
CURVE_MARGIN_DEG = 10.0
"""Curves are sampled past the data by this much, so that a head does not end where they do."""


@dataclass(frozen=True)
class Recipe:
    """rotation_weight: of the distance |R - R'|. average: share of the running mean of the weights
    that a step leaves; 0: the last weights. components: principal components of the features that the
    encoder is trained on, 0: the features themselves; floor: added to the standard deviation of each."""

    layers: tuple[int, ...] = (1404, 384, 128, 64, 9)
    head_layers: tuple[int, ...] = (3, 64, 64, 1)
    epochs: int = 30
    batch: int = 256
    learning_rate: float = 2e-3
    weight_decay: float = 1e-2
    average: float = 0.998
    seed: int = 0
    continuous: bool = True
    disturbances: Disturbances = field(default_factory=Disturbances)
    rotation_weight: float = 1.0
    components: int = 400
    floor: float = 0.01


PAPER = Recipe(
    layers=PAPER_LAYERS,
    head_layers=HEAD_LAYERS,
    epochs=60,
    learning_rate=1e-3,
    weight_decay=0,
    average=0,
    continuous=False,
    disturbances=NONE,
    rotation_weight=0,
    components=0,
)
RECIPES = {"continuous": Recipe(), "paper": PAPER}


def recipe_named(name: str, epochs: int | None = None, seed: int = 0) -> Recipe:
    """One of RECIPES with another seed and, unless None, number of epochs. UsageError if unknown."""
    if name not in RECIPES:
        raise UsageError(f"recipe {name!r}: expected one of {', '.join(RECIPES)}")
    recipe = RECIPES[name]
    return replace(recipe, seed=seed, epochs=recipe.epochs if epochs is None else epochs)


def train(
    rows: Rows, model: TensorModel, recipe: Recipe, folder: Path, progress: Progress | None = None
) -> PoseNetwork:
    """Train, or go on where the checkpoint in folder stopped.

    Parameters
    ----------
    rows: training rows. With the paper's recipe every pose must be one of the model's grid.
    folder: where the checkpoint is; it is written after every epoch.

    Raises
    ------
    ModelError: a checkpoint of another recipe or other data, or a pose off the grid.
    """
    dataset = _Samples.of(rows, model, recipe)
    curves = _Curves(model, rows.ypr_deg)
    scale = [float(np.abs(r).max()) for r in model.manifolds.range_deg]
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(recipe.seed)
        network = PoseNetwork(dataset.layers(recipe), recipe.head_layers, scale)
    optimizer = torch.optim.AdamW(
        network.parameters(), lr=recipe.learning_rate, weight_decay=recipe.weight_decay
    )

    def running(mean: torch.Tensor, now: torch.Tensor, steps: torch.Tensor | int) -> torch.Tensor:
        # The first steps weigh more, or a short training would keep its random start.
        return torch.lerp(now, mean, min(recipe.average, float(1 + steps) / float(10 + steps)))

    average = AveragedModel(network, avg_fn=running)
    identity = _identity(recipe, dataset, model)
    checkpoint = folder / CHECKPOINT
    first = _resume(checkpoint, network, average, optimizer, identity) if checkpoint.exists() else 0
    for epoch in range(first, recipe.epochs):
        # A generator an epoch: resuming needs no random state but the epoch's number.
        rng = np.random.default_rng([recipe.seed, epoch])
        for group in optimizer.param_groups:
            group["lr"] = recipe.learning_rate * 0.5 * (1 + np.cos(np.pi * epoch / recipe.epochs))
        loss = _epoch(network, average, optimizer, dataset, curves, recipe, rng)
        _save(checkpoint, network, average, optimizer, identity, epoch + 1)
        if progress is not None:
            progress(epoch + 1, recipe.epochs, loss)
    return _whole(average.module, dataset, recipe, scale)  # type: ignore[arg-type]


def _whole(network: PoseNetwork, dataset: _Samples, recipe: Recipe, scale: list[float]) -> PoseNetwork:
    """The network of the features themselves: W B^T (x - m) + b = (W B^T) x + (b - W B^T m)."""
    if dataset.basis is None:
        return network.eval()
    whole = PoseNetwork(recipe.layers, recipe.head_layers, scale)
    state = network.state_dict()
    weight = state["encoder.0.weight"].double().numpy() @ dataset.basis.T
    bias = state["encoder.0.bias"].double().numpy() - weight @ dataset.mean
    state["encoder.0.weight"], state["encoder.0.bias"] = torch.tensor(weight), torch.tensor(bias)
    whole.load_state_dict(state)
    return whole.eval()


def _epoch(
    network: PoseNetwork,
    average: AveragedModel,
    optimizer: torch.optim.Optimizer,
    dataset: _Samples,
    curves: _Curves,
    recipe: Recipe,
    rng: np.random.Generator,
) -> float:
    network.train()
    total, steps = 0.0, 0
    order = rng.permutation(len(dataset.rotation))
    for first in range(0, len(order), recipe.batch):
        features, factors, rotation = dataset.batch(order[first : first + recipe.batch], recipe, rng)
        points, angles = curves.draw(recipe.batch, rng)
        encoded = network.encoder(features)
        scale = network.scale_deg
        loss = nn.functional.mse_loss(encoded, factors) / curves.variance
        loss = loss + nn.functional.mse_loss(network.angles(points) / scale, angles / scale)
        if recipe.rotation_weight:
            turned = rotation_of(network.angles(encoded))
            # The distance, not its square: what is reported is a mean of angles.
            distance = ((turned - rotation).square().sum(dim=(1, 2)) + 1e-6).sqrt().mean()
            loss = loss + recipe.rotation_weight * distance
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        average.update_parameters(network)
        total += loss.item()
        steps += 1
    return total / steps


@dataclass(frozen=True)
class _Samples:
    """faces float32 [N, 468, 3], normalised, level where shapes are; rotation float64 [N, 3, 3];
    shapes float32 [H, 468, 3] of augment.shapes_of, and no factors; or factors float32 [N, 9] of the
    grid's poses. mean float64 [1404], basis float64 [1404, K]: what the encoder sees is
    (x - mean) basis, or x itself.

    The directions in which faces differ least are a hundredth of those in which poses do, and tell most
    about where a face's zero is. A gradient would find them last.
    """

    faces: np.ndarray
    rotation: np.ndarray
    shapes: np.ndarray | None
    factors: np.ndarray | None
    mean: np.ndarray
    basis: np.ndarray | None
    model: TensorModel

    @staticmethod
    def of(rows: Rows, model: TensorModel, recipe: Recipe) -> _Samples:
        faces = normalise(rows.landmarks, model.normalisation).astype(np.float32)
        mean, basis = _basis(faces, recipe)
        if recipe.continuous:
            level = levelled(faces, rows.rotation)
            shapes = shapes_of(level, rows.heads, rows.ypr_deg)
            return _Samples(level, rows.rotation, shapes, None, mean, basis, model)
        columns = []
        for k, (axis, factor) in enumerate(zip(model.axes_deg, model.poses, strict=True)):
            place = np.abs(rows.ypr_deg[:, k, None] - axis).argmin(axis=1)
            if np.abs(rows.ypr_deg[:, k] - axis[place]).max() > 1e-6:
                raise ModelError("the paper's recipe needs poses on the grid; use the continuous one")
            columns.append(factor[place])
        return _Samples(faces, rows.rotation, None, np.concatenate(columns, axis=1), mean, basis, model)

    def layers(self, recipe: Recipe) -> tuple[int, ...]:
        """Widths of the encoder for what it sees."""
        return recipe.layers if self.basis is None else (self.basis.shape[1], *recipe.layers[1:])

    def batch(
        self, chosen: np.ndarray, recipe: Recipe, rng: np.random.Generator
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """What the encoder sees [B, K], factor vectors [B, 9] and R_C [B, 3, 3]."""
        faces, rotation = self.faces[chosen], self.rotation[chosen]
        if self.shapes is None:
            assert self.factors is not None
            factors = self.factors[chosen]
        else:
            faces, rotation = disturbed(faces, rotation, self.shapes, recipe.disturbances, rng)
            faces = normalise(faces, self.model.normalisation)
            factors = np.concatenate(self.model.manifolds.values(angles_from_rotation(rotation)), axis=1)
        features = faces.reshape(len(chosen), -1)
        if self.basis is not None:
            features = (features - self.mean) @ self.basis
        arrays = (features, factors, rotation)
        seen, targets, turned = (torch.from_numpy(np.asarray(a, dtype=np.float32)) for a in arrays)
        return seen, targets, turned


def _basis(faces: np.ndarray, recipe: Recipe) -> tuple[np.ndarray, np.ndarray | None]:
    """Mean and basis of :class:`_Samples`: principal directions, each divided by its deviation."""
    features = faces.reshape(len(faces), -1).astype(np.float64)
    if not recipe.components:
        return np.zeros(features.shape[1]), None
    mean = features.mean(axis=0)
    centred = features - mean
    variance, directions = np.linalg.eigh(centred.T @ centred / len(centred))
    kept = np.argsort(variance)[::-1][: recipe.components]
    return mean, directions[:, kept] / (np.sqrt(np.maximum(variance[kept], 0)) + recipe.floor)


class _Curves:
    """Points of the cosine curves at fine steps: what the heads learn from."""

    def __init__(self, model: TensorModel, ypr_deg: np.ndarray) -> None:
        ranges = model.manifolds.range_deg
        self._low = np.minimum(ranges[:, 0], ypr_deg.min(axis=0)) - CURVE_MARGIN_DEG
        high = np.maximum(ranges[:, 1], ypr_deg.max(axis=0)) + CURVE_MARGIN_DEG
        self._steps = ((high - self._low) / CURVE_STEP_DEG).astype(int)
        self._manifolds = model.manifolds
        self.variance = float(np.mean([factor.var() for factor in model.poses]))

    def draw(self, count: int, rng: np.random.Generator) -> tuple[torch.Tensor, torch.Tensor]:
        """Factor vectors float32 [count, 9] and their angles float32 [count, 3]."""
        angles = self._low + CURVE_STEP_DEG * rng.integers(self._steps + 1, size=(count, 3))
        points = np.concatenate(self._manifolds.values(angles), axis=1)
        return torch.from_numpy(points.astype(np.float32)), torch.from_numpy(angles.astype(np.float32))


def _identity(recipe: Recipe, dataset: _Samples, model: TensorModel) -> str:
    """Names recipe and data, so that a checkpoint is never continued with others."""
    digest = hashlib.sha256()
    for array in (dataset.faces, dataset.rotation, *model.poses, *model.manifolds.params):
        digest.update(np.ascontiguousarray(array).tobytes())
    return json.dumps({"recipe": asdict(recipe), "data": digest.hexdigest()}, sort_keys=True)


def _save(
    path: Path,
    network: PoseNetwork,
    average: AveragedModel,
    optimizer: torch.optim.AdamW,
    identity: str,
    epochs: int,
) -> None:
    from safetensors.torch import save_file

    tensors = {f"network.{name}": value for name, value in network.state_dict().items()}
    tensors |= {f"average.{name}": value for name, value in average.state_dict().items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"adam.{index}.{name}": value for name, value in state.items()}
    scratch = path.with_suffix(".tmp")
    save_file(
        {name: value.contiguous() for name, value in tensors.items()},
        scratch,
        metadata=packed(CHECKPOINT_FORMAT, {"identity": identity, "epochs": epochs}),
    )
    os.replace(scratch, path)


def _resume(
    path: Path, network: PoseNetwork, average: AveragedModel, optimizer: torch.optim.AdamW, identity: str
) -> int:
    """Load the checkpoint; returns the epochs it has behind it."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata()
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dict
    except (OSError, SafetensorError) as error:
        raise ModelError(
            f"{path}: not a readable checkpoint ({str(error).splitlines()[0]}); delete it"
        ) from error
    facts = unpacked(path, CHECKPOINT_FORMAT, metadata)
    if facts.get("identity") != identity:
        raise ModelError(
            f"{path}: a checkpoint of another recipe or other data; delete it or choose another folder"
        )
    parts: dict[str, dict[str, torch.Tensor]] = {"network": {}, "average": {}}
    state: dict[int, dict[str, Any]] = {}
    for name, value in tensors.items():
        part, _, key = name.partition(".")
        if part == "adam":
            index, _, moment = key.partition(".")
            state.setdefault(int(index), {})[moment] = value
        else:
            parts[part][key] = value
    network.load_state_dict(parts["network"])
    average.load_state_dict(parts["average"])
    optimizer.load_state_dict({**optimizer.state_dict(), "state": state})
    return int(facts["epochs"])
