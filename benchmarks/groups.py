# SPDX-License-Identifier: MIT
"""How many faces of a group photograph are found, with tiles and without, and in videos of one.

python benchmarks/groups.py    # two portraits of scikit-image's and matplotlib's, pasted into 1600 x 1067
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
import skimage.data
from PIL import Image

from downstream_hpe.prediction.detector import FaceDetector
from downstream_hpe.prediction.predictor import Predictor
from downstream_hpe.prediction.way_up import WayUp

GROUPS = ((5, 160), (5, 100), (15, 80), (15, 60), (29, 40), (29, 30))
"""How many, and how wide their faces, pixels."""
SIZE = (1600, 1067)
FACE = 0.625
"""Of the width of a portrait as it is cut."""
PANS = ((15, 80), (29, 40))
FRAMES = 30
MORE = 10
"""So many more are asked for, which would be nobody's."""


def main() -> int:
    heads = portraits()
    detector = FaceDetector()
    detector.faces(np.asarray(heads[0])[..., ::-1])
    print("| faces | of so many pixels | the whole picture | and tiles | nobody's | seconds, best of three |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")
    for count, width in GROUPS:
        picture, middles = group(heads, count, round(width / FACE))
        plain, _ = hits(detector.faces(picture, count + MORE, turned=False), middles, width)
        took = []
        for _ in range(3):
            began = time.perf_counter()
            found = detector.faces(picture, count + MORE)
            took.append(time.perf_counter() - began)
        tiled, others = hits(found, middles, width)
        print(f"| {count} | {width} | {plain} | {tiled} | {others} | {min(took):.1f} |")
    print("\n| faces | of so many pixels | each frame alone | a second | followed | a second |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: |")
    for count, width in PANS:
        pan(heads, count, width)
    return 0


def pan(heads: tuple[Image.Image, ...], count: int, width: int) -> None:
    """A row of the second table: a camera that moves over a group, FRAMES of 1280 x 720."""
    picture, _ = group(heads, count, round(width / FACE))
    frames = [np.ascontiguousarray(picture[:720, 5 * n : 5 * n + 1280]) for n in range(FRAMES)]
    cells = []
    with Predictor() as predictor:
        way_up = WayUp()
        ways: list[Callable[[int], np.ndarray]] = [
            lambda n: predictor.faces(frames[n], count + MORE, False),
            lambda n: way_up.faces(predictor, frames[n], count + MORE, n / 25),
        ]
        for way in ways:
            seen, took = [], []
            for n in range(FRAMES):
                began = time.perf_counter()
                seen.append(len(way(n)))
                took.append(time.perf_counter() - began)
            cells.append(f"{min(seen)} to {max(seen)} | {1 / np.median(took):.1f}")
    print(f"| {count} | {width} | {cells[0]} | {cells[1]} |")


def portraits() -> tuple[Image.Image, ...]:
    """Of two women, cut to the head."""
    admiral = Path(matplotlib.__file__).parent / "mpl-data" / "sample_data" / "grace_hopper.jpg"
    with Image.open(admiral) as opened:
        second = opened.convert("RGB").crop((155, 40, 385, 320))
    return Image.fromarray(skimage.data.astronaut()).crop((150, 20, 310, 210)), second


def group(heads: tuple[Image.Image, ...], count: int, width: int) -> tuple[np.ndarray, np.ndarray]:
    """uint8 [H, W, 3], BGR, with so many heads, so many pixels wide, and their middles [count, 2]."""
    rng = np.random.default_rng(0)
    noise = rng.integers(60, 140, (33, 50, 3), dtype=np.uint8)
    whole = Image.fromarray(noise).resize(SIZE, Image.Resampling.BICUBIC)
    columns = int(np.ceil(np.sqrt(count * SIZE[0] / SIZE[1])))
    cell = np.array([SIZE[0] // columns, SIZE[1] // -(-count // columns)])
    middles = []
    for n in range(count):
        head = heads[n % len(heads)]
        head = head.resize((width, width * head.height // head.width), Image.Resampling.LANCZOS)
        corner = cell * (n % columns, n // columns) + rng.uniform(0, 1, 2) * np.maximum(cell - head.size, 1)
        whole.paste(head, tuple(corner.astype(int).tolist()))
        middles.append(corner + np.array(head.size) / 2)
    return np.asarray(whole)[..., ::-1], np.array(middles)


def hits(found: np.ndarray, middles: np.ndarray, width: float) -> tuple[int, int]:
    """How many of the middles have a face, and how many faces are at none."""
    if not len(found):
        return 0, 0
    centres = (found[..., :2].min(axis=1) + found[..., :2].max(axis=1)) / 2
    near = np.linalg.norm(centres[:, None] - middles, axis=-1) < 0.6 * width
    return int(near.any(axis=0).sum()), int((~near.any(axis=1)).sum())


if __name__ == "__main__":
    sys.exit(main())
