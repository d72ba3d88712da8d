# SPDX-License-Identifier: MIT
"""Where a training stopped: network, running mean, optimiser and epoch, in one file."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch.optim.swa_utils import AveragedModel

from downstream_hpe.errors import ModelError
from downstream_hpe.manifold.tensor_model import TensorModel
from downstream_hpe.model_file import MAX_BYTES, packed, unpacked
from downstream_hpe.networks.pose_network import PoseNetwork
from downstream_hpe.networks.recipe import Recipe
from downstream_hpe.networks.samples import Samples
from downstream_hpe.reading import check_regular

CHECKPOINT = "checkpoint.safetensors"
CHECKPOINT_FORMAT = "downstream-hpe checkpoint 2"


def identity_of(recipe: Recipe, dataset: Samples, model: TensorModel) -> str:
    """Names recipe and data, so that a checkpoint is never continued with others."""
    digest = hashlib.sha256()
    for array in (dataset.faces, dataset.rotation, *model.poses, *model.manifolds.params):
        digest.update(np.ascontiguousarray(array).tobytes())
    return json.dumps({"recipe": asdict(recipe), "data": digest.hexdigest()}, sort_keys=True)


def save(
    path: Path,
    network: PoseNetwork,
    average: AveragedModel,
    optimizer: torch.optim.AdamW,
    identity: str,
    epochs: int,
) -> None:
    """Replace the checkpoint; the old one stays whole until the new one is."""
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


def resume(
    path: Path, network: PoseNetwork, average: AveragedModel, optimizer: torch.optim.AdamW, identity: str
) -> int:
    """Load the checkpoint; returns the epochs it has behind it.

    Raises
    ------
    ModelError: not readable, or of another recipe or other data.
    """
    from safetensors import SafetensorError, safe_open

    try:
        check_regular(path, MAX_BYTES)
        with safe_open(path, framework="pt") as file:
            metadata = file.metadata()
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dict
    except (OSError, ValueError, SafetensorError) as error:
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
    try:
        epochs = int(facts["epochs"])
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
    except (KeyError, ValueError, TypeError, RuntimeError) as error:
        raise ModelError(f"{path}: not the parts of a checkpoint; delete it") from error
    return epochs
