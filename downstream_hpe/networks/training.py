# SPDX-License-Identifier: MIT
"""Training of the encoder and the heads: resumable, and the same for the same seed.

Two recipes share one loop. `paper`: the encoder learns the rows of A^(y), A^(p), A^(r) of each grid
pose, and each head learns its angle from points of its cosine curves. `continuous`: any pose, its
targets from the curves; faces of other people through other lenses (augment.py); a loss on the
rotation that encoder and heads give together; and the average of the weights over the last steps.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import torch
from torch import nn
from torch.optim.swa_utils import AveragedModel

from downstream_hpe.manifold.tensor_model import TensorModel
from downstream_hpe.networks import checkpoint
from downstream_hpe.networks.pose_network import PoseNetwork, rotation_of
from downstream_hpe.networks.recipe import Recipe
from downstream_hpe.networks.rigid_fit import RigidFit
from downstream_hpe.networks.samples import Curves, Samples
from downstream_hpe.tables.rows import Rows

Progress = Callable[[int, int, float], None]
"""Called with (epochs done, epochs in all, mean loss)."""


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
    dataset = Samples.of(rows, model, recipe)
    curves = Curves(model, rows.ypr_deg)
    scale = [float(np.abs(r).max()) for r in model.manifolds.range_deg]
    rigid = RigidFit.of(dataset.faces, model.manifolds, recipe.components) if recipe.continuous else None
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(recipe.seed)
        network = PoseNetwork(recipe.layers, recipe.head_layers, scale, rigid)
    optimizer = torch.optim.AdamW(
        network.parameters(), lr=recipe.learning_rate, weight_decay=recipe.weight_decay
    )

    def running(mean: torch.Tensor, now: torch.Tensor, steps: torch.Tensor | int) -> torch.Tensor:
        # The first steps weigh more, or a short training would keep its random start.
        return torch.lerp(now, mean, min(recipe.average, float(1 + steps) / float(10 + steps)))

    average = AveragedModel(network, avg_fn=running)
    identity = checkpoint.identity_of(recipe, dataset, model)
    stopped = folder / checkpoint.CHECKPOINT
    first = 0
    if stopped.exists():
        first = checkpoint.resume(stopped, network, average, optimizer, identity)
    for epoch in range(first, recipe.epochs):
        # A generator an epoch: resuming needs no random state but the epoch's number.
        rng = np.random.default_rng([recipe.seed, epoch])
        for group in optimizer.param_groups:
            group["lr"] = recipe.learning_rate * 0.5 * (1 + np.cos(np.pi * epoch / recipe.epochs))
        loss = _epoch(network, average, optimizer, dataset, curves, recipe, rng)
        checkpoint.save(stopped, network, average, optimizer, identity, epoch + 1)
        if progress is not None:
            progress(epoch + 1, recipe.epochs, loss)
    return average.module.eval()  # type: ignore[return-value]


def _epoch(
    network: PoseNetwork,
    average: AveragedModel,
    optimizer: torch.optim.Optimizer,
    dataset: Samples,
    curves: Curves,
    recipe: Recipe,
    rng: np.random.Generator,
) -> float:
    network.train()
    total, steps = 0.0, 0
    rows = len(dataset.rotation)
    times = max(1, -(-recipe.least_steps * recipe.batch // rows))
    order = np.concatenate([rng.permutation(rows) for _ in range(times)])
    for first in range(0, len(order), recipe.batch):
        features, factors, rotation = dataset.batch(order[first : first + recipe.batch], recipe, rng)
        points, angles = curves.draw(recipe.batch, rng)
        encoded = network.factors(features)
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
