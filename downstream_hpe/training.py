# SPDX-License-Identifier: MIT
"""Training of the encoder and the heads: resumable, and the same for the same seed.

Two recipes share one loop. `paper`: the encoder learns the rows of A^(y), A^(p), A^(r) of each grid
pose, and each head learns its angle from points of its cosine curves. `continuous`: poses beside the
grid too, by turning landmarks and label together; targets from the curves; noise, stretch and depth
errors like a detector's; and a loss on the rotation that encoder and heads give together.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from downstream_hpe.errors import ModelError, UsageError
from downstream_hpe.model import Progress, TensorModel, packed, unpacked
from downstream_hpe.networks import PAPER_LAYERS, PoseNetwork, rotation_of
from downstream_hpe.normalise import normalise
from downstream_hpe.rotation import angles_from_rotation, rotation_from_angles
from downstream_hpe.tables import Rows

CHECKPOINT = "checkpoint.safetensors"
CHECKPOINT_FORMAT = "downstream-hpe checkpoint 1"
CURVE_STEP_DEG = 0.1
CURVE_MARGIN_DEG = 10.0
"""Curves are sampled past the grid by this much, so that a head does not end where the data do."""


@dataclass(frozen=True)
class Recipe:
    """turn_deg: standard deviation of the random turn. jitter, stretch, depth: standard deviations
    of the noise of a point (in units of the face's RMS radius), of the face's width and of its
    depth (both relative). rotation_weight: of the squared chordal distance |R - R'|^2."""

    layers: tuple[int, ...] = (1404, 256, 128, 64, 9)
    epochs: int = 60
    batch: int = 256
    learning_rate: float = 1e-3
    seed: int = 0
    continuous: bool = True
    turn_deg: float = 6.0
    jitter: float = 0.01
    stretch: float = 0.02
    depth: float = 0.05
    rotation_weight: float = 1.0


PAPER = Recipe(
    layers=PAPER_LAYERS, continuous=False, turn_deg=0, jitter=0, stretch=0, depth=0, rotation_weight=0
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
    curves = _Curves(model)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(recipe.seed)
        network = PoseNetwork(recipe.layers, [float(np.abs(r).max()) for r in model.manifolds.range_deg])
    optimizer = torch.optim.Adam(network.parameters(), lr=recipe.learning_rate)
    identity = _identity(recipe, dataset, model)
    checkpoint = folder / CHECKPOINT
    first = _resume(checkpoint, network, optimizer, identity) if checkpoint.exists() else 0
    for epoch in range(first, recipe.epochs):
        # A generator an epoch: resuming needs no random state but the epoch's number.
        rng = np.random.default_rng([recipe.seed, epoch])
        for group in optimizer.param_groups:
            group["lr"] = recipe.learning_rate * 0.5 * (1 + np.cos(np.pi * epoch / recipe.epochs))
        loss = _epoch(network, optimizer, dataset, curves, recipe, rng)
        _save(checkpoint, network, optimizer, identity, epoch + 1)
        if progress is not None:
            progress(epoch + 1, recipe.epochs, loss)
    return network.eval()


def _epoch(
    network: PoseNetwork,
    optimizer: torch.optim.Optimizer,
    dataset: _Samples,
    curves: _Curves,
    recipe: Recipe,
    rng: np.random.Generator,
) -> float:
    network.train()
    total, steps = 0.0, 0
    order = rng.permutation(len(dataset.landmarks))
    for first in range(0, len(order), recipe.batch):
        features, factors, rotation = dataset.batch(order[first : first + recipe.batch], recipe, rng)
        points, angles = curves.draw(recipe.batch, rng)
        encoded = network.encoder(features)
        scale = network.scale_deg
        loss = nn.functional.mse_loss(encoded, factors) / curves.variance
        loss = loss + nn.functional.mse_loss(network.angles(points) / scale, angles / scale)
        if recipe.rotation_weight:
            turned = rotation_of(network.angles(encoded))
            loss = loss + recipe.rotation_weight * (turned - rotation).square().sum(dim=(1, 2)).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
        total += loss.item()
        steps += 1
    return total / steps


@dataclass(frozen=True)
class _Samples:
    """landmarks float32 [N, 468, 3] normalised; rotation float64 [N, 3, 3]; factors float32 [N, 9]
    of the grid poses, or None where they come from the curves."""

    landmarks: np.ndarray
    rotation: np.ndarray
    factors: np.ndarray | None
    model: TensorModel

    @staticmethod
    def of(rows: Rows, model: TensorModel, recipe: Recipe) -> _Samples:
        factors = None
        if not recipe.continuous:
            columns = []
            for k, (axis, factor) in enumerate(zip(model.axes_deg, model.poses, strict=True)):
                place = np.abs(rows.ypr_deg[:, k, None] - axis).argmin(axis=1)
                if np.abs(rows.ypr_deg[:, k] - axis[place]).max() > 1e-6:
                    raise ModelError("the paper's recipe needs poses on the grid; use the continuous one")
                columns.append(factor[place])
            factors = np.concatenate(columns, axis=1).astype(np.float32)
        landmarks = normalise(rows.landmarks, model.normalisation).astype(np.float32)
        return _Samples(landmarks, rows.rotation, factors, model)

    def batch(
        self, chosen: np.ndarray, recipe: Recipe, rng: np.random.Generator
    ) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Features [B, 1404], factor vectors [B, 9] and R_C [B, 3, 3]."""
        landmarks, rotation = self.landmarks[chosen], self.rotation[chosen]
        if self.factors is not None:
            factors = self.factors[chosen]
        else:
            landmarks, rotation = disturbed(landmarks, rotation, recipe, rng)
            landmarks = normalise(landmarks, self.model.normalisation)
            factors = np.concatenate(self.model.manifolds.values(angles_from_rotation(rotation)), axis=1)
        arrays = (landmarks.reshape(len(chosen), -1), factors, rotation)
        features, targets, turned = (torch.from_numpy(np.asarray(a, dtype=np.float32)) for a in arrays)
        return features, targets, turned


def disturbed(
    landmarks: np.ndarray, rotation: np.ndarray, recipe: Recipe, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Landmarks [B, 468, 3] and R_C [B, 3, 3] turned together by a random rotation Q: x Q^T and
    Q R_C; then only the landmarks stretched, deepened and jittered."""
    count = len(landmarks)
    # Small turns about all three axes: the composition of Euler angles is close enough to isotropic.
    turn = rotation_from_angles(rng.normal(scale=recipe.turn_deg, size=(count, 3)))
    turned = landmarks @ np.swapaxes(turn, -1, -2).astype(np.float32)
    scale = 1 + rng.normal(size=(count, 1, 3)) * [recipe.stretch, 0.0, recipe.depth]
    noise = rng.standard_normal(landmarks.shape, dtype=np.float32) * np.float32(recipe.jitter)
    return turned * scale.astype(np.float32) + noise, turn @ rotation


class _Curves:
    """Points of the cosine curves at fine steps: what the heads learn from."""

    def __init__(self, model: TensorModel) -> None:
        self._low = model.manifolds.range_deg[:, 0] - CURVE_MARGIN_DEG
        self._steps = (np.ptp(model.manifolds.range_deg, axis=1) + 2 * CURVE_MARGIN_DEG) / CURVE_STEP_DEG
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
    for array in (dataset.landmarks, dataset.rotation, *model.poses, *model.manifolds.params):
        digest.update(np.ascontiguousarray(array).tobytes())
    return json.dumps({"recipe": asdict(recipe), "data": digest.hexdigest()}, sort_keys=True)


def _save(path: Path, network: PoseNetwork, optimizer: torch.optim.Adam, identity: str, epochs: int) -> None:
    from safetensors.torch import save_file

    tensors = {f"network.{name}": value for name, value in network.state_dict().items()}
    for index, state in optimizer.state_dict()["state"].items():
        tensors |= {f"adam.{index}.{name}": value for name, value in state.items()}
    scratch = path.with_suffix(".tmp")
    save_file(
        {name: value.contiguous() for name, value in tensors.items()},
        scratch,
        metadata=packed(CHECKPOINT_FORMAT, {"identity": identity, "epochs": epochs}),
    )
    os.replace(scratch, path)


def _resume(path: Path, network: PoseNetwork, optimizer: torch.optim.Adam, identity: str) -> int:
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
    network.load_state_dict(
        {
            name.removeprefix("network."): value
            for name, value in tensors.items()
            if name.startswith("network.")
        }
    )
    state: dict[int, dict[str, Any]] = {}
    for name, value in tensors.items():
        if name.startswith("adam."):
            _, index, key = name.split(".")
            state.setdefault(int(index), {})[key] = value
    optimizer.load_state_dict({**optimizer.state_dict(), "state": state})
    return int(facts["epochs"])
