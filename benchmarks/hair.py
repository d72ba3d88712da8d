# SPDX-License-Identifier: GPL-3.0-or-later
"""What hair, beards, brows and clothes cost: triangles, time to make, and rendering time an image.

    python benchmarks/hair.py [--poses 40] [--resolution 256]

One parametric head before the fast preset, at the same poses with each style and without, in turns. Times are
the processor's, of the render worker and of the maker, so that a busy machine changes them little; the least
of --rounds is printed.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path

import numpy as np

from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import LaneOptions
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.package import save_package
from generator.heads.parametric.make import make_heads
from generator.heads.source import find_heads
from generator.plan.config import load_config
from generator.plan.settings import Landmarks
from generator.plan.view_plan import plan_views
from generator.plan.views import Views
from generator.plan.wear import STYLES, Worn
from generator.registries import WORN
from generator.worn.fit import CannotWear, Fit

KINDS = ("hair", "beard", "brows", "clothes")


def main() -> None:
    """Make, render, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--poses", type=int, default=40)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=list(KINDS))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--resolution", type=int, default=256)
    parser.add_argument("--threads", type=int, default=1, help="of the renderer")
    given = parser.parse_args()
    config = load_config(None, {"render": {"resolution": given.resolution}})
    rng = np.random.default_rng(0)
    poses = [tuple(rng.uniform((-50, -25, -10), (50, 25, 10)).tolist()) for _ in range(given.poses)]
    with tempfile.TemporaryDirectory(prefix="headturn-hair-") as name:
        folder = Path(name)
        make_heads(folder / "heads", count=1, seed=5)
        lane = Lane(LaneOptions(scratch=name, threads=given.threads))
        try:
            [head] = find_heads(folder / "heads").heads
            placed = lane.placer(Landmarks()).subject([head], "level")
            anchors = placed.facts[0].anchors
            assert anchors is not None, "a parametric head has anchors"
            turned = anchors.points @ CAMERA_FROM_GRAPHICS @ placed.placement.levelling.T
            fit = Fit(placed.placement.normalise(lane.read(head)), turned)
            save_package(fit.mesh, folder / "head.npz")
            views = plan_views(config, head.name, placed.placement.radius_mm, poses)
            looks: dict[str, tuple[Worn, ...]] = {"nothing": ()}
            said = {"nothing": f"{len(fit.mesh.triangles):6d} triangles of the head"}
            for kind in given.kinds:
                for style in STYLES[kind][1:]:
                    what = f"{kind} {style}"
                    try:
                        looks[what], said[what] = _made(fit, kind, style, folder)
                    except CannotWear as reason:
                        print(f"{what}: {reason}")
            times: dict[str, list[float]] = {what: [] for what in looks}
            for _ in range(given.rounds):
                for what, worn in looks.items():
                    times[what].append(_seconds(lane, folder / "head.npz", views, worn))
        finally:
            lane.close()
    bare = min(times["nothing"])
    for what, seconds in times.items():
        more = 100 * (min(seconds) / bare - 1)
        print(f"{what:18s} {1000 * min(seconds):6.1f} ms an image ({more:+4.0f} %), {said[what]}")


def _made(fit: Fit, kind: str, style: str, folder: Path) -> tuple[tuple[Worn, ...], str]:
    took = []
    for seed in range(3):
        began = time.process_time()
        mesh = WORN.get(kind).make(fit, style, np.random.default_rng(seed))
        took.append(time.process_time() - began)
    path = folder / f"{kind}-{style}.npz"
    save_package(mesh, path)
    said = f"{len(mesh.triangles):6d} triangles made in {1000 * statistics.median(took):4.0f} ms"
    return (Worn(str(path)),), said


def _seconds(lane: Lane, package: Path, views: Views, worn: tuple[Worn, ...]) -> float:
    """Of the processor for an image, after one that loads everything."""
    rendered = lane.renderer.render(package, views, worn=(worn,) * len(views))
    next(rendered).unlink()
    began = _processor_s(lane.renderer.pid)
    count = 0
    for path in rendered:
        path.unlink()
        count += 1
    return (_processor_s(lane.renderer.pid) - began) / count


def _processor_s(pid: int) -> float:
    """What a process has had of the processor so far; Linux alone says it of another."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


if __name__ == "__main__":
    main()
