# SPDX-License-Identifier: MIT
"""Fit what tells a plausible face to renders, and print what it is worth.

    headturn build --count 24 --seed 2024 --sampled-expressions 1 --poses sobol:6 --variety photo \\
        --yaw=-40,40 --pitch=-30,30 --roll=-30,30 --resolution 256 --frame level --out varied
    headturn build --count 24 --seed 2024 --poses sobol:4 --mask choice:medical,cloth,ffp2 --images none \\
        --yaw=-40,40 --pitch=-30,30 --roll=-30,30 --resolution 256 --frame level --out masked
    python scripts/make_face_shapes.py varied masked

Writes ``downstream_hpe/models/face_shapes.npz``. Plausible are the faces found in the first dataset;
implausible are those found in its pictures turned upside down, and in the second, all mirrored, too. Every
fourth of each is left out, to print how many of them are told.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from downstream_hpe.geometry.face_mesh import POINTS, mirror_pairs
from downstream_hpe.geometry.rotation import fit_rotation
from downstream_hpe.prediction.detector import FaceDetector
from downstream_hpe.prediction.pictures import read_bgr
from downstream_hpe.prediction.plausibility import FACE_SHAPES, SOME, FaceShapes
from downstream_hpe.tables.rows import read_rows

COMPONENTS = 32
ROUNDS = 5
SHRINKAGE = 0.1
"""Of the weights, a unit being the spread of plausible faces: what renders teach should hold elsewhere."""
PRIOR = np.log(2.0)
"""A face in a picture is twice as likely to be plausible as not."""


def mirrored_too(landmarks: np.ndarray) -> np.ndarray:
    """Every face [N, 468, 3] and its mirror image."""
    return np.concatenate([landmarks, landmarks[:, mirror_pairs()] * [-1.0, 1.0, 1.0]])


def upside_down(dataset: Path) -> np.ndarray:
    """What the detector finds in pictures that are turned by 180 degrees, as if they were not."""
    detector = FaceDetector()
    files = sorted((dataset / "images").rglob("*.png"))
    found = [detector.mesh(np.ascontiguousarray(read_bgr(file)[::-1, ::-1, ::-1])) for file in files]
    print(f"upside down: a face in {sum(map(len, found))} of {len(files)} pictures")
    return np.array([face for faces in found for face in faces]).reshape(-1, POINTS, 3)


def shapes(landmarks: np.ndarray) -> FaceShapes:
    """Mean and basis of faces at any pose, aligned to their own mean."""
    faces = landmarks - landmarks[:, SOME].mean(axis=1, keepdims=True)
    faces /= np.sqrt(np.square(faces[:, SOME]).sum(axis=2).mean(axis=1))[:, None, None]
    mean = faces[0]
    for _ in range(ROUNDS):
        level = faces @ fit_rotation(mean[SOME], faces[:, SOME])
        mean = level.mean(axis=0)
        mean /= np.sqrt(np.square(mean[SOME]).sum(axis=1).mean())
    residual = (level - mean)[:, SOME].reshape(len(level), -1)
    _, _, components = np.linalg.svd(residual, full_matrices=False)
    return FaceShapes(mean, components[:COMPONENTS], np.zeros(COMPONENTS + 1), 0.0)


def fitted(blank: FaceShapes, plausible: np.ndarray, not_so: np.ndarray) -> FaceShapes:
    """Logistic regression on the quantities, both classes with the same weight."""
    good, bad = blank.quantities(plausible), blank.quantities(not_so)
    middle, scale = good.mean(axis=0), good.std(axis=0)
    good, bad = (good - middle) / scale, (bad - middle) / scale

    def loss(parameters: np.ndarray) -> tuple[float, np.ndarray]:
        bias, weights = parameters[0], parameters[1:]
        value, gradient = SHRINKAGE * np.square(weights).sum(), np.append(0.0, 2 * SHRINKAGE * weights)
        for given, sign in ((good, 1.0), (bad, -1.0)):
            logit = bias - given @ weights
            value += np.logaddexp(0, -sign * logit).mean()
            slope = -sign * expit(-sign * logit) / len(given)
            gradient += np.append(slope.sum(), -slope @ given)
        return float(value), gradient

    found = minimize(loss, np.zeros(1 + good.shape[1]), jac=True, method="L-BFGS-B").x
    weights = found[1:] / scale
    return FaceShapes(blank.mean, blank.basis, weights, float(found[0] + middle @ weights + PRIOR))


def main() -> int:
    if len(sys.argv) != 3:
        print(__doc__)
        return 2
    varied, masked = map(Path, sys.argv[1:])
    kinds = {
        "plausible": read_rows(varied).landmarks.astype(np.float64),
        "upside down": upside_down(varied),
        "masked": read_rows(masked).landmarks.astype(np.float64),
    }
    kept = {name: np.arange(len(faces)) % 4 != 3 for name, faces in kinds.items()}
    train = {name: mirrored_too(faces[kept[name]]) for name, faces in kinds.items()}
    not_so = np.concatenate([train["upside down"], train["masked"]])
    model = fitted(shapes(train["plausible"]), train["plausible"], not_so)
    print(f"bias {model.bias:.3f}, weight of what is left {model.weights[-1]:.3f}")
    print("               fitted to: at least 0.5   left out: at least 0.5   mean")
    for name, faces in kinds.items():
        said = [model.plausibility(faces[kept[name] == is_kept]) for is_kept in (True, False)]
        shares = [f"{(s >= 0.5).sum():4} of {len(s):4}" for s in said]
        print(f"{name:14} {shares[0]:26} {shares[1]:22} {said[1].mean():6.2f}")
    arrays = {"mean": model.mean, "basis": model.basis, "weights": model.weights, "bias": model.bias}
    np.savez_compressed(FACE_SHAPES, **{k: np.asarray(v, dtype=np.float32) for k, v in arrays.items()})
    print(f"{FACE_SHAPES.name}: {FACE_SHAPES.stat().st_size / 1e3:.0f} kB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
