# SPDX-License-Identifier: MIT
"""How far translations are off, and by what: a dataset says where its heads are.

headturn build --count 24 --seed 2025 --poses sobol:6 --images none --frame level --out heads
python benchmarks/six_degrees.py heads

Every row's camera K is known, and nothing else of it. The error of the distance is in % of it, the
direction's in degrees.
"""

from __future__ import annotations

import sys

import numpy as np
import pyarrow.dataset as ds

from downstream_hpe.geometry.camera import Camera, fit_translation
from downstream_hpe.geometry.face_mesh import POINTS
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.prediction.predictor import Predictor

COLUMNS = ("rotation", "camera", "translation_mm", "landmarks", "landmarks_exact", "detected")


def report(name: str, found: np.ndarray, true: np.ndarray) -> None:
    """One line: found, true float [N, 3], mm."""
    far, truly = np.linalg.norm(found, axis=1), np.linalg.norm(true, axis=1)
    share = 100 * (far / truly - 1)
    angle = np.rad2deg(np.arccos(np.clip((found * true).sum(axis=1) / (far * truly), -1, 1)))
    print(f"{name:52} {np.abs(share).mean():6.2f} %   {share.mean():+6.2f} %   {angle.mean():5.2f} deg")


def main() -> int:
    if len(sys.argv) != 2:
        print(__doc__)
        return 2
    table = ds.dataset(f"{sys.argv[1]}/data").to_table(columns=list(COLUMNS))
    table = table.filter(table["detected"])
    values = {name: np.stack(table[name].to_numpy()).astype(np.float64) for name in COLUMNS[:-1]}
    true = values["translation_mm"]
    rotation = values["rotation"].reshape(-1, 3, 3)
    heads = values["landmarks_exact"].reshape(-1, POINTS, 3)
    predictor = Predictor.load()
    kinds: dict[str, list[np.ndarray]] = {}
    for n in range(len(true)):
        camera = Camera(values["camera"][n].reshape(3, 3))
        seen = values["landmarks"][n].reshape(1, POINTS, 3)
        turned = rotation[n : n + 1]
        exact = camera.pixels(heads[n : n + 1])
        model = predictor.from_landmarks(seen, camera)
        fits = {
            "exact landmarks, the label's rotation, its own head": fit_translation(
                (heads[n] - true[n]) @ rotation[n], turned, exact, camera
            ),
            "exact landmarks, the label's rotation, mean head": fit_translation(
                mean_head(), turned, exact, camera
            ),
            "detected landmarks, the model's rotation, mean head": model.translation_mm,
        }
        for name, found in fits.items():
            kinds.setdefault(name, []).append(np.asarray(found)[0])
    print(f"{len(true)} rows; mean of                                     |error|      error    direction")
    for name, every in kinds.items():
        report(name, np.stack(every), true)
    return 0


if __name__ == "__main__":
    sys.exit(main())
