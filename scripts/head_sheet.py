# SPDX-License-Identifier: GPL-3.0-or-later
"""One picture of many parametric heads, rendered as a build would, to look at them side by side.

    python scripts/head_sheet.py OUT.jpg --count 48 --seed 5 --yaw -25

Faces are level in the mesh's own axes and cropped to the face; nothing is detected. About a second a head.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import LaneOptions
from generator.heads.package import save_package
from generator.heads.parametric import make_heads
from generator.heads.placement import Placement
from generator.heads.source import find_heads
from generator.placing.rendering import read_image
from generator.plan.config import load_config
from generator.plan.view_plan import plan_views

FACE_MM = (0.0, -25.0, 20.0)
"""What the picture is centred on, from the middle between the ears at eye height."""

RADIUS_MM = 118.0
"""Of the sphere that fills the picture: the face and its outline, not the whole head."""


def faces(heads: Path, poses: list[tuple[float, float, float]], pixels: int) -> list[list[np.ndarray]]:
    """Pictures of every head of a folder at some poses, uint8 [pixels, pixels, 3] RGB each."""
    config = load_config(None, {"render": {"resolution": pixels, "lens_mm": 200.0}})
    place = Placement("mm", 1.0, "+Y", "+Z", FACE_MM, RADIUS_MM, 90.0)
    made = []
    with tempfile.TemporaryDirectory() as scratch:
        lane = Lane(LaneOptions(scratch=scratch))
        package = Path(scratch) / "head.npz"
        try:
            for head in find_heads(heads).heads:
                save_package(place.normalise(lane.read(head)), package)
                views = plan_views(config, head.name, place.radius_mm, poses)
                made.append([read_image(path) for path in lane.renderer.render(package, views)])
        finally:
            lane.close()
    return made


def sheet(tiles: list[np.ndarray], columns: int) -> np.ndarray:
    """Tiles of one size in rows."""
    blank = [np.zeros_like(tiles[0])] * (-len(tiles) % columns)
    tiles = tiles + blank
    return np.vstack([np.hstack(tiles[k : k + columns]) for k in range(0, len(tiles), columns)])


def main() -> None:
    """Make heads, render them, write the picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--count", type=int, default=48)
    parser.add_argument("--seed", type=int, default=5)
    parser.add_argument("--expressions", type=int, default=0, help="sampled ones a head, besides the neutral")
    parser.add_argument("--yaw", type=float, nargs="+", default=[-20.0], help="degrees, a picture each")
    parser.add_argument("--pitch", type=float, default=0.0)
    parser.add_argument("--pixels", type=int, default=200)
    parser.add_argument("--columns", type=int, default=8)
    given = parser.parse_args()
    poses = [(yaw, given.pitch, 0.0) for yaw in given.yaw]
    with tempfile.TemporaryDirectory() as folder:
        make_heads(Path(folder), count=given.count, seed=given.seed, expressions=given.expressions)
        tiles = [tile for head in faces(Path(folder), poses, given.pixels) for tile in head]
    Image.fromarray(sheet(tiles, given.columns)).save(given.out, quality=85)


if __name__ == "__main__":
    main()
