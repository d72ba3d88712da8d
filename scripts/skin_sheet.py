# SPDX-License-Identifier: GPL-3.0-or-later
"""Parametric heads as paint alone and with occlusion, gloss, relief and lamps, and what that costs.

    python scripts/skin_sheet.py docs/images/skin.jpg
    python scripts/skin_sheet.py beside.jpg --photograph
    python scripts/skin_sheet.py --time 40

The upper row is lit by the environment alone, as in earlier releases; the lower by the same with all that
--variety photo draws of how surfaces answer light, with --photograph beside one of a person, to judge
them by (scikit-image's astronaut: NASA, public domain). With --time, images of 256 pixels of the first head
are rendered in both ways by turns, each in its own light and pose; medians and least times are printed.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from head_sheet import FACE_MM, RADIUS_MM
from PIL import Image
from skimage import data

from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import LaneOptions
from generator.heads.package import load_package, save_package
from generator.heads.parametric import make_heads
from generator.heads.placement import Placement
from generator.heads.source import find_heads
from generator.landmarks.occlusion import with_occlusion
from generator.picture.scenery import Folders
from generator.plan.config import load_config
from generator.plan.settings import Look
from generator.plan.shading import unshaded
from generator.plan.view_plan import framed_camera
from generator.plan.views import View, Views

LIGHTS = (
    Look(environment="studio", environment_yaw_deg=-20.0, environment_strength=0.9),
    Look(environment="city", environment_yaw_deg=60.0, environment_strength=0.7),
    Look(environment="interior", environment_yaw_deg=150.0, environment_strength=0.9),
    Look(lamp1_strength=0.35, lamp1_warmth=-1.2, lamp2_strength=0.7, lamp2_warmth=1.2, ambient=0.4),
)
"""One for each head, as if it were the lower row's."""

SKIN = {"occlusion": 0.95, "gloss": 0.45, "skin_detail": 0.9}

TIMED = Look(environment="studio", lamp1_strength=0.3, **SKIN)  # type: ignore[arg-type]


def packages(count: int, seed: int, lane: Lane, folder: Path) -> list[Path]:
    """Heads that stand, as packages."""
    make_heads(folder / "heads", count=count, seed=seed)
    place = Placement("mm", 1.0, "+Y", "+Z", FACE_MM, RADIUS_MM, 90.0)
    made = []
    for head in find_heads(folder / "heads").heads:
        textures = folder / head.subject
        textures.mkdir()
        made.append(folder / f"{head.subject}.npz")
        save_package(with_occlusion(place.normalise(lane.read(head, textures))), made[-1])
    return made


def sheet(heads: list[Path], lane: Lane, pixels: int, beside: bool) -> np.ndarray:
    """Two rows: without and with. beside: a photograph."""
    config = load_config(None, {"render": {"resolution": pixels, "lens_mm": 200.0}})
    camera = framed_camera(config.render, RADIUS_MM)
    columns = []
    for head, light in zip(heads, LIGHTS, strict=True):
        looks = (unshaded(light), replace(light, **SKIN))
        views = Views.of([View((18.0, 0.0, 0.0), camera, look) for look in looks])
        columns.append(np.vstack([*lane.shots.take(head, views, Folders())]))
    return np.hstack([*columns, photograph(pixels)] if beside else columns)


def photograph(pixels: int) -> np.ndarray:
    """A woman's head and shoulders, uint8 [2 pixels, pixels, 3]."""
    cut = Image.fromarray(data.astronaut()[:380, 130:320])
    return np.asarray(cut.resize((pixels, 2 * pixels), Image.Resampling.LANCZOS))


def timed(head: Path, lane: Lane, images: int) -> str:
    """Milliseconds an image, and their ratio."""
    camera = framed_camera(load_config(None, {}).render, RADIUS_MM)
    rng = np.random.default_rng(0)
    spent: dict[bool, list[float]] = {False: [], True: []}
    for _ in range(images // 10 + 1):
        for shaded, times in spent.items():
            look = TIMED if shaded else unshaded(TIMED)
            turns, yaws = (rng.uniform(-limit, limit, 11).round(1).tolist() for limit in (180, 40))
            looks = [replace(look, environment_yaw_deg=turn) for turn in turns]
            poses = [(yaw, 0.0, 0.0) for yaw in yaws]
            views = Views(tuple(poses), (camera,), tuple(looks))
            began = time.perf_counter()
            for k, _ in enumerate(lane.shots.take(head, views, Folders())):
                now = time.perf_counter()
                if k:  # the first builds the stage
                    times.append(1e3 * (now - began))
                began = now
    mesh = replace(load_package(head), openness=None)
    began = time.perf_counter()
    with_occlusion(mesh)
    lines = [f"occlusion of {len(mesh.vertices)} vertices: {time.perf_counter() - began:.2f} s"]
    for name, pick in (("median", np.median), ("least", np.min)):
        before, after = (float(pick(spent[shaded])) for shaded in (False, True))
        lines.append(f"{name:6} {before:6.1f} ms without, {after:6.1f} ms with, {after / before:.2f} times")
    return "\n".join(lines)


def main() -> None:
    """Make heads, render them, write the picture or say the times."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path, nargs="?")
    parser.add_argument("--seed", type=int, default=11)
    parser.add_argument("--pixels", type=int, default=360)
    parser.add_argument("--photograph", action="store_true")
    parser.add_argument("--time", type=int, default=0, metavar="IMAGES")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        lane = Lane(LaneOptions(scratch=name, threads=1))
        try:
            heads = packages(len(LIGHTS) if given.out else 1, given.seed, lane, Path(name))
            if given.out:
                Image.fromarray(sheet(heads, lane, given.pixels, given.photograph)).save(
                    given.out, quality=88
                )
            if given.time:
                print(timed(heads[0], lane, given.time))
        finally:
            lane.close()


if __name__ == "__main__":
    main()
