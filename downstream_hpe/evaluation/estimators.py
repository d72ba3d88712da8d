# SPDX-License-Identifier: MIT
"""The model and what it is measured beside: each takes landmarks and gives angles."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from downstream_hpe.evaluation.scores import Evaluation, evaluate
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.partial import completed
from downstream_hpe.geometry.rotation import angles_from_rotation, fit_rotation
from downstream_hpe.manifold.tensor_model import TENSOR_FILE, TensorModel
from downstream_hpe.prediction.predictor import Predictor, model_folder
from downstream_hpe.tables.rows import Rows

Estimator = Callable[[np.ndarray], np.ndarray]
"""Landmarks float [N, 468, 3], NaN where not seen -> (yaw, pitch, roll) in degrees, float [N, 3]."""


def constant_zero(landmarks: np.ndarray) -> np.ndarray:
    """The baseline that always answers (0, 0, 0). Implements Estimator."""
    return np.zeros((len(landmarks), 3))


def rigid_fit(reference: np.ndarray) -> Estimator:
    """The baseline that fits a reference face [468, 3], frame C, rigidly to the landmarks."""

    def estimate(landmarks: np.ndarray) -> np.ndarray:
        return angles_from_rotation(fit_rotation(reference, np.asarray(landmarks, dtype=np.float64)))

    return estimate


def estimators(folder: Path, reference: np.ndarray | None = None) -> dict[str, Estimator]:
    """The baselines and the model of a folder, by name.

    reference: float [468, 3], frame C, for the rigid fit; None: the mean face of the training set.
    """
    model = TensorModel.load(folder / TENSOR_FILE)
    predictor = Predictor.load(folder)
    reconstruction = model.estimator()
    face, of = (model.reference, "mean face") if reference is None else (reference, "reference face")
    return {
        "constant zero": constant_zero,
        f"rigid fit to {of}": rigid_fit(face),
        "reconstruction": lambda landmarks: reconstruction.from_landmarks(_whole(landmarks)).ypr_deg,
        "encoder + heads": lambda landmarks: predictor.from_landmarks(landmarks).ypr_deg,
    }


def _whole(landmarks: np.ndarray) -> np.ndarray:
    return completed(landmarks, mean_head()) if np.isnan(landmarks).any() else landmarks


def reference_face(model: str, given: np.ndarray | None) -> np.ndarray | None:
    """The face of the rigid fit: the one given, or the mean face of a model's folder; a file has none."""
    folder = model_folder(model)
    if given is not None or folder is None:
        return given
    return TensorModel.load(folder / TENSOR_FILE).reference


def model_estimators(model: str, predictor: Predictor, reference: np.ndarray | None) -> dict[str, Estimator]:
    """The model beside its baselines, by name; of a single .onnx file, beside those that need no more.

    predictor: the model's. reference: as :func:`estimators`.
    """
    folder = model_folder(model)
    if folder is not None:
        return estimators(folder, reference)
    every: dict[str, Estimator] = {"constant zero": constant_zero}
    if reference is not None:
        every["rigid fit to reference face"] = rigid_fit(reference)
    every["encoder + heads"] = lambda landmarks: predictor.from_landmarks(landmarks).ypr_deg
    return every


def compare(rows: Rows, every: dict[str, Estimator]) -> list[Evaluation]:
    """Every estimator on the same rows."""
    return [evaluate(name, estimate(rows.landmarks), rows.rotation) for name, estimate in every.items()]
