# SPDX-License-Identifier: GPL-3.0-or-later
"""What samples and denoising of the quality preset cost, and how far they move the landmarks that are found.

    python benchmarks/quality.py [--poses 24] [--resolution 256]

One parametric head, path traced at the same poses by one thread: with many samples that nothing is taken out
of (the reference), and with few, denoised or not, each laid over grey as a build does it. Printed of each:
the processor's time an image, how far its landmarks are from the reference's (root mean square of an image,
mean of all), and the pixels' difference.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import OpenEXR

from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import LaneOptions
from generator.heads.package import load_package, save_package
from generator.heads.parametric.make import make_heads
from generator.heads.source import find_heads
from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh
from generator.picture.backdrop import before
from generator.picture.develop import softened, to_bytes
from generator.plan.config import BuildConfig
from generator.plan.settings import Landmarks, Render
from generator.plan.view_plan import plan_views
from generator.process import few_cores

REFERENCE = "64 samples, as they are"
LOOKS = {
    REFERENCE: (64, False),
    "4 samples, as they are": (4, False),
    "2 samples, as they are": (2, False),
    "4 samples, denoised": (4, True),
    "2 samples, denoised": (2, True),
    "1 sample, denoised": (1, True),
}
PACKAGE, FACTS = "head.npz", "facts.json"
GREY = 0.2140  # linear, of 0.5 in sRGB


def main() -> None:
    """Render, detect, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--poses", type=int, default=24)
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--render", help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.render:
        _render(Path(given.render), given.resolution)
        return
    poses = np.random.default_rng(0).uniform((-40, -30, -20), (40, 30, 20), (given.poses, 3)).tolist()
    with tempfile.TemporaryDirectory(prefix="headturn-quality-") as name:
        folder = Path(name)
        radius_mm = _head(folder)
        (folder / FACTS).write_text(json.dumps({"poses": poses, "radius_mm": radius_mm}), encoding="utf-8")
        own = [sys.executable, __file__, "--render", name, "--resolution", str(given.resolution)]
        # Blender says all that it does on its way.
        subprocess.run(own, check=True, stdout=subprocess.DEVNULL)
        _compare(folder, given.poses, given.resolution)


def _head(folder: Path) -> float:
    """Write the package of a placed head; the radius of its sphere, mm."""
    make_heads(folder / "heads", count=1, seed=5)
    lane = Lane(LaneOptions(scratch=str(folder), threads=1))
    try:
        [head] = find_heads(folder / "heads").heads
        placement = lane.placer(Landmarks()).subject([head], "level").placement
        save_package(placement.normalise(lane.read(head)), folder / PACKAGE)
        return placement.radius_mm
    finally:
        lane.close()


def _render(folder: Path, resolution: int) -> None:
    """Every look at every pose, and the time of each look."""
    with few_cores(1):
        import bpy

    from generator.blender.images import Images

    facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))
    mesh = load_package(folder / PACKAGE)
    times, boxes = {}, {}
    for look, (samples, denoised) in LOOKS.items():
        config = BuildConfig(render=Render(resolution=resolution, preset="quality", samples=samples))
        poses = [tuple(pose) for pose in facts["poses"]]
        views = plan_views(config, "head/neutral", facts["radius_mm"], poses)
        images = Images(mesh, threads=1)
        (folder / look).mkdir()
        warm = folder / look / "warm.exr"
        images.render_over_nothing(next(iter(views)), warm)
        bpy.context.scene.cycles.use_denoising = denoised
        images.render_over_nothing(next(iter(views)), warm)
        began = time.process_time()
        boxes[look] = [
            images.render_over_nothing(view, folder / look / f"{n}.exr") for n, view in enumerate(views)
        ]
        times[look] = (time.process_time() - began) / len(poses)
    (folder / FACTS).write_text(json.dumps({"times": times, "boxes": boxes}), encoding="utf-8")


def _picture(path: Path, box: tuple[int, int, int, int], resolution: int, denoised: bool) -> np.ndarray:
    with OpenEXR.File(str(path)) as file:
        head = np.array(file.channels()["RGBA"].pixels, dtype=np.float32)
    if denoised:
        head[..., 3] = softened(head[..., 3])
    left, right, bottom, top = box
    picture = np.full((resolution, resolution, 3), GREY, dtype=np.float32)
    there = picture[resolution - top : resolution - bottom, left:right]
    there[...] = before(head, there)
    return to_bytes(picture)


def _compare(folder: Path, count: int, resolution: int) -> None:
    facts = json.loads((folder / FACTS).read_text(encoding="utf-8"))
    times = facts["times"]
    detector = MediaPipeFaceMesh()
    pictures = {
        look: [
            _picture(folder / look / f"{n}.exr", facts["boxes"][look][n], resolution, denoised)
            for n in range(count)
        ]
        for look, (_, denoised) in LOOKS.items()
    }
    found = {look: [detector.detect(picture) for picture in every] for look, every in pictures.items()}
    detector.close()
    before = times["4 samples, as they are"]
    print(f"{'':24s} {'ms an image':>12s} {'of 4 samples':>13s} {'landmarks off':>14s} {'pixels off':>11s}")
    for look in LOOKS:
        pairs = list(zip(found[look], found[REFERENCE], strict=True))
        shifts = [
            np.sqrt(np.mean(np.sum((one - other)[:, :2] ** 2, axis=1)))
            for one, other in pairs
            if one is not None and other is not None
        ]
        off = np.mean(
            [
                np.sqrt(np.mean((one.astype(float) - other) ** 2))
                for one, other in zip(pictures[look], pictures[REFERENCE], strict=True)
            ]
        )
        milliseconds = 1000 * times[look]
        print(
            f"{look:24s} {milliseconds:12.1f} {times[look] / before:12.2f}x {np.mean(shifts):11.2f} px "
            f"{off:7.2f}/255 ({sum(one is not None for one in found[look])} of {count} found)"
        )


if __name__ == "__main__":
    main()
