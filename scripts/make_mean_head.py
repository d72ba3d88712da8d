# SPDX-License-Identifier: GPL-3.0-or-later
"""Measure the mean head of a dataset, which downstream_hpe gets the scale of its translations from.

    headturn build --count 24 --seed 2024 --frame level --images none --out heads
    python scripts/make_mean_head.py heads

Writes ``downstream_hpe/models/mean_head.csv``: the mean of the heads' anchors, mirrored, in mm, frame C, with
the pivot at the origin. Prints how far heads are from it in size, which is how far translations are off.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from downstream_hpe.geometry.face_mesh import LEFT_EYE, RIGHT_EYE, mirror_pairs
from downstream_hpe.geometry.mean_head import MEAN_HEAD
from generator.dataset.format.anchors_table import read_anchors


def main() -> None:
    """Measure, write, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("dataset", type=Path)
    anchors = read_anchors(parser.parse_args().dataset).values()
    every = np.stack([head.points for head in anchors if head.expression == "neutral"])
    heads = every[np.isfinite(every).all(axis=(1, 2))]
    mean = heads.mean(axis=0)
    mean = (mean + mean[mirror_pairs()] * [-1.0, 1.0, 1.0]) / 2
    header = "x,y,z in mm, frame C, pivot at the origin; made by scripts/make_mean_head.py"
    np.savetxt(MEAN_HEAD, mean, fmt="%.2f", delimiter=",", header=header)
    eyes = np.linalg.norm(heads[:, RIGHT_EYE] - heads[:, LEFT_EYE], axis=1)
    sizes = np.sqrt(np.square(heads - heads.mean(axis=1, keepdims=True)).sum(axis=2).mean(axis=1))
    print(f"{len(heads)} heads: outer corners of the eyes {eyes.mean():.1f} mm apart, sd {eyes.std():.1f} mm")
    print(f"size of the face: sd {100 * sizes.std() / sizes.mean():.1f} % of the mean")


if __name__ == "__main__":
    main()
