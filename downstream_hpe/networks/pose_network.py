# SPDX-License-Identifier: MIT
"""The encoder and the three heads: normalised landmarks -> factor vectors -> angles."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import torch
from torch import nn

from downstream_hpe.geometry.face_mesh import FEATURES
from downstream_hpe.networks.rigid_fit import RigidFit

PAPER_LAYERS = (FEATURES, 1024, 512, 256, 128, 64, 9)
HEAD_LAYERS = (3, 128, 256, 128, 64, 1)
REACH = 0.2
"""How far the encoder moves a factor vector that starts from a rigid fit: about 15 degrees."""


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

    rigid: with it the encoder does not see the landmarks but what their rigid fit makes of them, factor
    vectors, K coordinates of shape and the share that is not seen, and what it gives is added to those factor
    vectors, by REACH at most. It is then (9 + K + 1)-...-9, and landmarks may be NaN.
    """

    scale_deg: torch.Tensor

    def __init__(
        self,
        layers: Sequence[int] = PAPER_LAYERS,
        head_layers: Sequence[int] = HEAD_LAYERS,
        scale_deg: Sequence[float] = (50, 40, 30),
        rigid: RigidFit | None = None,
    ) -> None:
        super().__init__()
        if min(len(layers), len(head_layers)) < 2 or (layers[-1], head_layers[0], head_layers[-1]) != (
            9,
            3,
            1,
        ):
            raise ValueError(f"expected layers to 9 and heads from 3 to 1, got {layers} and {head_layers}")
        if rigid is not None and layers[0] != rigid.sees:
            raise ValueError(f"an encoder of {layers[0]} numbers after a rigid fit that gives {rigid.sees}")
        self.rigid = rigid
        self.encoder = multilayer(layers, nn.Tanh)
        self.heads = nn.ModuleList(multilayer(head_layers, nn.ReLU) for _ in range(3))
        self.register_buffer("scale_deg", torch.tensor(scale_deg, dtype=torch.float32))

    def angles(self, factors: torch.Tensor) -> torch.Tensor:
        """Factor vectors [N, 9] -> (yaw, pitch, roll) in degrees [N, 3]."""
        parts = factors.split(3, dim=-1)
        found = torch.cat([head(part) for head, part in zip(self.heads, parts, strict=True)], dim=-1)
        return found * self.scale_deg

    def factors(self, features: torch.Tensor) -> torch.Tensor:
        """Normalised landmarks [N, 1404] -> factor vectors [N, 9]."""
        if self.rigid is None:
            return self.encoder(features)
        start, shape = self.rigid(features)
        return start + REACH * torch.tanh(self.encoder(torch.cat([start, shape], dim=1)))

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Normalised landmarks [N, 1404] -> (yaw, pitch, roll) in degrees [N, 3]."""
        return self.angles(self.factors(features))


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
