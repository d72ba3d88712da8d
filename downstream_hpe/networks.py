# SPDX-License-Identifier: MIT
"""The encoder and the three heads: normalised landmarks -> factor vectors -> angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from downstream_hpe.confidence import Confidence
from downstream_hpe.errors import ModelError
from downstream_hpe.model import packed, read_safetensors
from downstream_hpe.normalise import FEATURES, NORMALISATIONS, Normalisation

PAPER_LAYERS = (1404, 1024, 512, 256, 128, 64, 9)
HEAD_LAYERS = (3, 128, 256, 128, 64, 1)
FORMAT = "downstream-hpe network 2"
_CONFIDENCE = "confidence."


def multilayer(widths: Sequence[int], last: type[nn.Module]) -> nn.Sequential:
    """Linear layers with ReLU between them, but `last` before the last one."""
    layers: list[nn.Module] = []
    for k, (inputs, outputs) in enumerate(pairwise(widths)):
        if k:
            layers.append(last() if k == len(widths) - 2 else nn.ReLU())
        layers.append(nn.Linear(inputs, outputs))
    return nn.Sequential(*layers)


class PoseNetwork(nn.Module):
    """The paper's network: encoder 1404-1024-512-256-128-64-9 and three heads 3-128-256-128-64-1.

    layers: widths of the encoder, to 9. head_layers: of a head, from 3 to 1. scale_deg: what
    one unit of a head's output is, in degrees, a float an angle.
    """

    scale_deg: torch.Tensor

    def __init__(
        self,
        layers: Sequence[int] = PAPER_LAYERS,
        head_layers: Sequence[int] = HEAD_LAYERS,
        scale_deg: Sequence[float] = (50, 40, 30),
    ) -> None:
        super().__init__()
        if min(len(layers), len(head_layers)) < 2 or (layers[-1], head_layers[0], head_layers[-1]) != (
            9,
            3,
            1,
        ):
            raise ValueError(f"expected layers to 9 and heads from 3 to 1, got {layers} and {head_layers}")
        self.encoder = multilayer(layers, nn.Tanh)
        self.heads = nn.ModuleList(multilayer(head_layers, nn.ReLU) for _ in range(3))
        self.register_buffer("scale_deg", torch.tensor(scale_deg, dtype=torch.float32))

    def angles(self, factors: torch.Tensor) -> torch.Tensor:
        """Factor vectors [N, 9] -> (yaw, pitch, roll) in degrees [N, 3]."""
        parts = factors.split(3, dim=-1)
        found = torch.cat([head(part) for head, part in zip(self.heads, parts, strict=True)], dim=-1)
        return found * self.scale_deg

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Normalised landmarks [N, 1404] -> (yaw, pitch, roll) in degrees [N, 3]."""
        return self.angles(self.encoder(features))


def rotation_of(ypr_deg: torch.Tensor) -> torch.Tensor:
    """R_C = Rx(-pitch) Ry(yaw) Rz(roll), differentiable: [N, 3] -> [N, 3, 3]."""
    y, p, r = torch.deg2rad(ypr_deg).unbind(-1)
    cy, sy, cp, sp, cr, sr = y.cos(), y.sin(), p.cos(), p.sin(), r.cos(), r.sin()
    rows = (
        (cy * cr, -cy * sr, sy),
        (cp * sr - sp * sy * cr, cp * cr + sp * sy * sr, sp * cy),
        (-sp * sr - cp * sy * cr, -sp * cr + cp * sy * sr, cp * cy),
    )
    return torch.stack([torch.stack(row, dim=-1) for row in rows], dim=-2)


def widths(layers: nn.Module) -> list[int]:
    """Widths of a chain of linear layers, from its input to its output."""
    linear = [layer for layer in layers.children() if isinstance(layer, nn.Linear)]
    return [linear[0].in_features, *(layer.out_features for layer in linear)]


@dataclass(frozen=True)
class Weights:
    """A network and what its graph needs beside it.

    range_deg: float [3, 2], the angles trained on. confidence: None where no face was held out to
    calibrate it. trained_subjects: whom the network has seen, so that nobody tests on them.
    pose_zero: "source" or "canonical", of :mod:`downstream_hpe.pose_zero`; None: not known.
    """

    network: PoseNetwork
    normalisation: Normalisation
    range_deg: np.ndarray
    confidence: Confidence | None = None
    trained_subjects: tuple[str, ...] = ()
    pose_zero: str | None = None

    def save(self, path: Path) -> None:
        """One safetensors file."""
        from safetensors.torch import save_file

        facts = {
            "layers": widths(self.network.encoder),
            "head_layers": widths(self.network.heads[0]),
            "normalisation": self.normalisation,
            "range_deg": self.range_deg.tolist(),
            "trained_subjects": list(self.trained_subjects),
            "pose_zero": self.pose_zero,
        }
        tensors = {name: value.contiguous() for name, value in self.network.state_dict().items()}
        if self.confidence is not None:
            for name, array in vars(self.confidence).items():
                tensors[_CONFIDENCE + name] = torch.tensor(array, dtype=torch.float64)
        save_file(tensors, path, metadata=packed(FORMAT, facts))

    @staticmethod
    def load(path: Path) -> Weights:
        """Raises ModelError where the file is not one that :meth:`save` wrote."""
        arrays, facts = read_safetensors(path, FORMAT)
        beside = {name: arrays.pop(name) for name in list(arrays) if name.startswith(_CONFIDENCE)}
        try:
            network = PoseNetwork(facts["layers"], facts["head_layers"])
            if facts["layers"][0] != FEATURES:
                raise ValueError(f"{facts['layers'][0]} features")
            network.load_state_dict({name: torch.from_numpy(array) for name, array in arrays.items()})
            parts: dict[str, Any] = {name.removeprefix(_CONFIDENCE): a for name, a in beside.items()}
            confidence = Confidence(**{**parts, "bias": float(parts["bias"])}) if parts else None
            ranges = np.array(facts["range_deg"], dtype=float)
            subjects, zero = tuple(facts["trained_subjects"]), facts.get("pose_zero")
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise ModelError(f"{path}: its weights do not fit its layers; fit the model again") from error
        if facts.get("normalisation") not in NORMALISATIONS or ranges.shape != (3, 2):
            raise ModelError(f"{path}: unknown normalisation or range; fit the model again")
        return Weights(network.eval(), facts["normalisation"], ranges, confidence, subjects, zero)
