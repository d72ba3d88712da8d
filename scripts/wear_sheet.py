# SPDX-License-Identifier: GPL-3.0-or-later
"""One picture of things that heads wear: a row a style, a tile a head and pose.

    python scripts/wear_sheet.py OUT.png --wear glasses:round headwear:cap,mask:medical --heads FOLDER ...
    python scripts/wear_sheet.py OUT.png --wear glasses:all --yaw 0 45 --keep /tmp/heads

A thing is KIND:STYLE; several that are worn together have commas between them, and "none" is the bare head.
Heads are parametric ones of --seed, --count of them (0 for none), and the first few of each folder of
--heads. With --keep the heads are placed once, and later calls take a second and what rendering takes.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from head_sheet import sheet
from PIL import Image

from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import LaneOptions
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.package import load_package, save_package
from generator.heads.parametric.make import make_heads
from generator.heads.source import find_heads
from generator.heads.surroundings import head_alone
from generator.placing.rendering import read_image
from generator.plan.config import load_config
from generator.plan.settings import Landmarks
from generator.plan.view_plan import plan_views
from generator.plan.wear import STYLES, Worn
from generator.registries import WORN
from generator.worn.fit import CannotWear, Fit, Kind

RADIUS_MM = 150.0
"""Of the sphere that fills a picture."""


def placed(lane: Lane, folder: Path, keep: Path, most: int) -> list[Path]:
    """Packages of the first heads of a folder, with their landmarks beside them in a .npy."""
    found = []
    for head in find_heads(folder).heads[:most]:
        package = keep / f"{folder.name}-{head.subject}-{head.expression}.npz".replace("/", "-")
        found.append(package)
        if package.with_suffix(".npy").exists():
            continue
        done = lane.placer(Landmarks()).subject([head], "level")
        textures = package.with_suffix("")
        textures.mkdir(exist_ok=True)
        mesh = head_alone(lane.read(head, textures), done.placement)
        save_package(done.placement.normalise(mesh), package)
        anchors = done.facts[0].anchors
        assert anchors is not None, "the first head of a subject that is placed has anchors"
        np.save(
            package.with_suffix(".npy"),
            anchors.points @ CAMERA_FROM_GRAPHICS @ done.placement.levelling.T,
        )
    return found


def dressed(fit: Fit, things: dict[str, str], seed: int, shift: np.ndarray, folder: Path) -> tuple[Worn, ...]:
    """What a head wears, moved by shift, as packages in a folder; what does not fit is said and left out."""
    worn = []
    for number, (kind, style) in enumerate(things.items()):
        maker: Kind = WORN.get(kind)
        others = {other: things[other] for other in maker.minds if other in things}
        start = time.perf_counter()
        try:
            rng = np.random.default_rng([seed, number])
            made = maker.make(fit.beside(others), style, rng)
        except CannotWear as reason:
            print(f"{kind}:{style}: {reason}", file=sys.stderr)
            continue
        took = 1000 * (time.perf_counter() - start)
        print(f"{kind}:{style} {len(made.triangles)} triangles, {took:.0f} ms")
        path = folder / f"worn-{time.monotonic_ns()}.npz"
        save_package(made, path)
        worn.append(Worn(str(path), tuple(shift.tolist())))
    return tuple(worn)


def main() -> None:
    """Place heads, dress them, render them, write the picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--wear", nargs="+", default=["none"], help="KIND:STYLE[,...], a row each")
    parser.add_argument("--heads", type=Path, nargs="*", default=[], help="folders of heads")
    parser.add_argument("--most", type=int, default=1, help="heads of each folder")
    parser.add_argument("--count", type=int, default=2, help="parametric heads")
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--yaw", type=float, nargs="+", default=[0.0], help="degrees, a tile each")
    parser.add_argument("--pitch", type=float, nargs="+", default=[0.0], help="degrees, a tile each")
    parser.add_argument("--pixels", type=int, default=256)
    parser.add_argument("--radius", type=float, default=RADIUS_MM, help="mm, of what is seen")
    parser.add_argument("--variant", type=int, default=0, help="seed of what is worn; each tile's head adds")
    parser.add_argument("--set", nargs="*", default=[], help="render settings, NAME=VALUE")
    parser.add_argument("--columns", type=int, help="tiles in a row; by default all of a style")
    parser.add_argument("--keep", type=Path, help="folder for heads that are placed already")
    given = parser.parse_args()
    poses = [(yaw, pitch, 0.0) for yaw in given.yaw for pitch in given.pitch]
    settings = dict(pair.split("=", 1) for pair in given.set)
    config = load_config(None, {"render": {"resolution": given.pixels, "lens_mm": 135.0, **settings}})
    rows = [row for text in given.wear for row in _rows(text)]
    tiles = []
    with tempfile.TemporaryDirectory() as scratch:
        keep = given.keep or Path(scratch) / "kept"
        keep.mkdir(parents=True, exist_ok=True)
        made = keep / f"parametric-{given.seed}"
        folders = list(given.heads)
        if given.count:
            make_heads(made, count=given.count, seed=given.seed, keep=True)
        lane = Lane(LaneOptions(scratch=scratch))
        try:
            packages = placed(lane, made, keep, given.count) if given.count else []
            packages += [package for folder in folders for package in placed(lane, folder, keep, given.most)]
            for things in rows:
                for number, package in enumerate(packages):
                    mesh, points = load_package(package), np.load(package.with_suffix(".npy"))
                    shift = np.array([0.0, 25.0, 0.0])
                    worn = dressed(
                        Fit(mesh, points, scratch=scratch),
                        things,
                        given.variant + number,
                        shift,
                        Path(scratch),
                    )
                    shown = Path(scratch) / "shown.npz"
                    save_package(replace(mesh, vertices=mesh.vertices + shift), shown)
                    views = plan_views(config, package.stem, given.radius, poses)
                    images = lane.renderer.render(shown, views, worn=(worn,) * len(views))
                    tiles += [read_image(path) for path in images]
        finally:
            lane.close()
    Image.fromarray(sheet(tiles, given.columns or len(packages) * len(poses))).save(given.out)


def _rows(text: str) -> list[dict[str, str]]:
    """What is worn together in each row: "glasses:all" is a row for each style."""
    if text == "none":
        return [{}]
    things = dict(pair.split(":", 1) for pair in text.split(","))
    rows = [things]
    for kind, style in things.items():
        if style == "all":
            rows = [{**row, kind: one} for row in rows for one in STYLES[kind][1:]]
    return rows


if __name__ == "__main__":
    main()
