# SPDX-License-Identifier: MIT
"""What is learned without a network: tensor factors, manifolds and a reference face, in one file."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from downstream_hpe.errors import ModelError
from downstream_hpe.manifold import Manifolds, fit_manifolds
from downstream_hpe.normalise import NORMALISATIONS, Normalisation
from downstream_hpe.reconstruction import ReconstructionEstimator
from downstream_hpe.tucker import Decomposition

FORMAT = "downstream-hpe tensor model 1"

ANGLES = ("yaw", "pitch", "roll")


@dataclass(frozen=True)
class TensorModel:
    """core W float64 [Ri, Ry, Rp, Rr, 1404]; axes_deg and poses: the grid's angles and the factor
    of yaw, pitch and roll; reference float64 [468, 3], frame C, level, RMS 1."""

    core: np.ndarray
    axes_deg: tuple[np.ndarray, ...]
    poses: tuple[np.ndarray, ...]
    manifolds: Manifolds
    reference: np.ndarray
    normalisation: Normalisation

    @staticmethod
    def of(
        fit: Decomposition,
        axes_deg: tuple[np.ndarray, ...],
        reference: np.ndarray,
        normalisation: Normalisation,
    ) -> TensorModel:
        """The model of a decomposition; fits its manifolds."""
        return TensorModel(
            fit.core, axes_deg, fit.poses, fit_manifolds(fit, axes_deg), reference, normalisation
        )

    def estimator(self) -> ReconstructionEstimator:
        """The estimator by reconstruction."""
        return ReconstructionEstimator(self.core, self.manifolds, self.normalisation)

    def save(self, path: Path) -> None:
        """One safetensors file."""
        from safetensors.numpy import save_file

        arrays = {"core": self.core, "reference": self.reference}
        for k, angle in enumerate(ANGLES):
            arrays[f"{angle}.axis_deg"] = self.axes_deg[k]
            arrays[f"{angle}.factor"] = self.poses[k]
            arrays[f"{angle}.params"] = self.manifolds.params[k]
        whole = {name: np.ascontiguousarray(array, dtype=np.float64) for name, array in arrays.items()}
        save_file(whole, path, metadata=packed(FORMAT, {"normalisation": self.normalisation}))

    @staticmethod
    def load(path: Path) -> TensorModel:
        """Raises ModelError where the file is not one that :meth:`save` wrote."""
        arrays, metadata = read_safetensors(path, FORMAT)
        try:
            axes = tuple(arrays[f"{angle}.axis_deg"] for angle in ANGLES)
            poses = tuple(arrays[f"{angle}.factor"] for angle in ANGLES)
            params = tuple(arrays[f"{angle}.params"] for angle in ANGLES)
            core, reference = arrays["core"], arrays["reference"]
        except KeyError as error:
            raise ModelError(f"{path}: no array {error}; fit the model again") from error
        normalisation = metadata.get("normalisation")
        shapes = [p.shape == (rank, 4) for p, rank in zip(params, core.shape[1:4], strict=False)]
        if normalisation not in NORMALISATIONS or len(shapes) != 3 or not all(shapes) or core.ndim != 5:
            raise ModelError(f"{path}: its arrays do not belong together; fit the model again")
        ranges = np.array([[axis[0], axis[-1]] for axis in axes])
        manifolds = Manifolds((params[0], params[1], params[2]), ranges)
        return TensorModel(core, axes, poses, manifolds, reference, normalisation)  # type: ignore[arg-type]


def packed(form: str, facts: Mapping[str, object]) -> dict[str, str]:
    """Facts as the metadata of a safetensors file: one entry, as it keeps several in no fixed order."""
    return {"downstream-hpe": json.dumps({**facts, "format": form}, sort_keys=True)}


def unpacked(path: Path, form: str, metadata: Mapping[str, str] | None) -> dict[str, Any]:
    """The facts that :func:`packed` packed. ModelError unless they are of that format."""
    try:
        facts = json.loads((metadata or {})["downstream-hpe"])
        found = facts["format"]
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise ModelError(f"{path}: not written by downstream-hpe; expected {form!r}") from error
    if found != form:
        raise ModelError(f"{path}: format {found!r}, expected {form!r}")
    return facts


def read_safetensors(path: Path, form: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and facts of a safetensors file. ModelError unless it is of that format."""
    from safetensors import SafetensorError, safe_open

    try:
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata()
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dict
    except (OSError, SafetensorError) as error:
        raise ModelError(f"{path}: not a readable model file ({str(error).splitlines()[0]})") from error
    return arrays, unpacked(path, form, metadata)


Progress = Callable[[int, int, float], None]
"""Called with (epochs done, epochs in all, mean loss)."""
