# SPDX-License-Identifier: MIT
"""How a network is trained: the recipes by name."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from downstream_hpe.errors import UsageError
from downstream_hpe.networks.augment import NONE, Disturbances
from downstream_hpe.networks.pose_network import HEAD_LAYERS, PAPER_LAYERS
from downstream_hpe.networks.rigid_fit import FACTORS


@dataclass(frozen=True)
class Recipe:
    """rotation_weight: of the distance |R - R'|. average: share of the running mean of the weights
    that a step leaves; 0: the last weights. components: coordinates of shape that the encoder sees beside
    the rigid fit's factor vectors; 0: it sees the landmarks.
    least_steps: of an epoch, which goes over few rows more than once for them."""

    layers: tuple[int, ...] = (FACTORS + 5 + 1, 64, 32, 9)
    head_layers: tuple[int, ...] = (3, 64, 64, 1)
    epochs: int = 20
    batch: int = 256
    learning_rate: float = 2e-3
    weight_decay: float = 1e-1
    average: float = 0.998
    seed: int = 0
    continuous: bool = True
    disturbances: Disturbances = field(default_factory=Disturbances)
    rotation_weight: float = 1.0
    components: int = 5
    least_steps: int = 20


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
    least_steps=0,
)
RECIPES = {"continuous": Recipe(), "paper": PAPER}


def recipe_named(name: str, epochs: int | None = None, seed: int = 0) -> Recipe:
    """One of RECIPES with another seed and, unless None, number of epochs. UsageError if unknown."""
    if name not in RECIPES:
        raise UsageError(f"recipe {name!r}: expected one of {', '.join(RECIPES)}")
    recipe = RECIPES[name]
    return replace(recipe, seed=seed, epochs=recipe.epochs if epochs is None else epochs)
