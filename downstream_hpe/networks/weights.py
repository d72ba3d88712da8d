# SPDX-License-Identifier: MIT
"""A trained network and what its graph needs beside it, in one file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from downstream_hpe.errors import ModelError
from downstream_hpe.geometry.face_mesh import FEATURES
from downstream_hpe.geometry.normalise import NORMALISATIONS, Normalisation
from downstream_hpe.model_file import packed, read_safetensors
from downstream_hpe.networks.confidence import Confidence
from downstream_hpe.networks.pose_network import PoseNetwork, widths
from downstream_hpe.networks.rigid_fit import RIGID_PARTS, RigidFit

NETWORK_FILE = "network.safetensors"
"""Its name in a model folder."""
FORMAT = "downstream-hpe network 4"
_CONFIDENCE, _RIGID = "confidence.", "rigid."


@dataclass(frozen=True)
class Weights:
    """A network and what its graph needs beside it.

    range_deg: float [3, 2], the angles trained on. confidence: None where no face was held out to
    calibrate it. trained_subjects: whom the network has seen, so that nobody tests on them.
    pose_zero: "source", "level" or "canonical", of :mod:`downstream_hpe.tables.pose_zero`; None: not known.
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
            parts = [arrays[_RIGID + name] for name in RIGID_PARTS if _RIGID + name in arrays]
            rigid = RigidFit(*parts) if parts else None
            network = PoseNetwork(facts["layers"], facts["head_layers"], rigid=rigid)
            if rigid is None and facts["layers"][0] != FEATURES:
                raise ValueError(f"{facts['layers'][0]} features")
            network.load_state_dict({name: torch.from_numpy(array) for name, array in arrays.items()})
            known: dict[str, Any] = {name.removeprefix(_CONFIDENCE): a for name, a in beside.items()}
            confidence = Confidence(**{**known, "bias": float(known["bias"])}) if known else None
            ranges = np.array(facts["range_deg"], dtype=float)
            subjects, zero = tuple(facts["trained_subjects"]), facts.get("pose_zero")
        except (KeyError, TypeError, ValueError, RuntimeError) as error:
            raise ModelError(f"{path}: its weights do not fit its layers; fit the model again") from error
        if facts.get("normalisation") not in NORMALISATIONS or ranges.shape != (3, 2):
            raise ModelError(f"{path}: unknown normalisation or range; fit the model again")
        return Weights(network.eval(), facts["normalisation"], ranges, confidence, subjects, zero)
