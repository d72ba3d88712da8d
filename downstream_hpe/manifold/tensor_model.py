# SPDX-License-Identifier: MIT
"""What is learned without a network: tensor factors, manifolds and a reference face, in one file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from downstream_hpe.errors import ModelError
from downstream_hpe.geometry.normalise import NORMALISATIONS, Normalisation
from downstream_hpe.geometry.rotation import ANGLES
from downstream_hpe.manifold.cosines import Manifolds, fit_manifolds
from downstream_hpe.manifold.reconstruction import ReconstructionEstimator
from downstream_hpe.manifold.tucker import Decomposition
from downstream_hpe.model_file import packed, read_safetensors

TENSOR_FILE = "tensor.safetensors"
"""Its name in a model folder."""
FORMAT = "downstream-hpe tensor model 1"


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
