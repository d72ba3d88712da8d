# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations as 6DRepNet trains on them: get_R and its first two columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from generator.dataset.export.options import Format
from generator.dataset.export.source import Source
from generator.geometry.rotation import graphics_rotation

ABOUT = """\
`labels.npz` has a row a sample: `name` (its sample_id), `image` (path in this folder; empty where the
dataset has no images), `split`, `R` float64 [N, 3, 3] = 6DRepNet's `get_R(pitch, yaw, roll)` =
Rz(roll) Ry(yaw) Rx(pitch), `ortho6d` float64 [N, 6] = the first two columns of R one after the other, which
`compute_rotation_matrix_from_ortho6d` turns back into R, and `angles_deg` (yaw, pitch, roll).
`labels_<split>.txt` has the same as text: image (or sample_id), then the nine numbers of R, row-major.

No class of 6DRepNet's datasets.py reads this: it is for code of one's own. That repository itself reads
`300w-lp`, which it trains on, and `fsanet-npz`.

R is the transpose of R_U = D R_C D, D = diag(1, -1, -1). No landmarks, so a row on which no face was
found has an exact label all the same.
"""


def write(source: Source, folder: Path) -> str:
    """Write the export; returns what its README says about it."""
    names, images, splits, rotations, angles = [], [], [], [], []
    for sample in source.samples():
        image = ""
        if sample.image:
            image = f"images/{sample.sample_id}{sample.image_suffix}"
            path = folder / image
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(sample.image)
        names.append(sample.sample_id)
        images.append(image)
        splits.append(sample.split)
        rotations.append(get_r(sample.rotation))
        angles.append(sample.angles_deg)
    matrices = np.array(rotations).reshape(-1, 3, 3)
    np.savez_compressed(
        folder / "labels.npz",
        name=np.array(names),
        image=np.array(images),
        split=np.array(splits),
        R=matrices,
        ortho6d=np.concatenate([matrices[:, :, 0], matrices[:, :, 1]], axis=1),
        angles_deg=np.array(angles).reshape(-1, 3),
    )
    for split in sorted(set(splits)):
        lines = [
            " ".join([(image or name).replace(" ", "\\ "), *(f"{value:.17g}" for value in matrix.ravel())])
            for name, image, row_split, matrix in zip(names, images, splits, matrices, strict=True)
            if row_split == split
        ]
        (folder / f"labels_{split}.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return ABOUT


def get_r(rotation: np.ndarray) -> np.ndarray:
    """6DRepNet's get_R of R_C. [..., 3, 3] -> [..., 3, 3]."""
    return np.swapaxes(graphics_rotation(rotation), -1, -2)


FORMAT = Format(
    write,
    readers="6D rotation losses in code of one's own",
    holds="`labels.npz` and text: get_R, its first two columns",
    written="`R` = Rz(roll) Ry(yaw) Rx(pitch)",
    back="D Rᵀ D",
    note="6DRepNet's own code reads 300w-lp and fsanet-npz; this is for code of one's own",
)
