# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole grid of a Blender scene, built through the scene's own camera, verified, some of it rendered again.

    python benchmarks/scene_grid.py [--resolution 64] [--deep 25]

The scene is that of the tests (tests/execution/make_scene.py): a parametric head with an armature, a shape
key and hair curves, an off-centre camera with shifts and pixels that are not square; one sample a pixel.
Prints what build and verify print.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from generator.heads.parametric.make import make_heads
from generator.heads.read import read_mesh
from generator.heads.source import find_heads
from generator.interpreter import python_command

MAKE_SCENE = Path(__file__).resolve().parents[1] / "tests" / "execution" / "make_scene.py"


def make_scene(folder: Path) -> Path:
    """The scene of the tests."""
    make_heads(folder / "heads", count=1, seed=1)
    mesh = read_mesh(find_heads(folder / "heads").heads[0], folder)
    colors = np.ones((len(mesh.vertices), 4)) * (0.8, 0.6, 0.5, 1.0)
    np.savez(folder / "head.npz", vertices=mesh.vertices, triangles=mesh.triangles, colors=colors)
    names = ("head.npz", "scene.blend", "ran.txt")
    command = [sys.executable, str(MAKE_SCENE), *(str(folder / name) for name in names)]
    subprocess.run(command, check=True, capture_output=True, timeout=300)
    return folder / "scene.blend"


def main() -> None:
    """Make, build, verify."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--resolution", type=int, default=64)
    parser.add_argument("--deep", type=int, default=25, help="rows that are rendered again")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="headturn-scene-") as name:
        scene, dataset = make_scene(Path(name)), str(Path(name) / "dataset")
        build = [
            "build",
            str(scene),
            "--expression",
            "neutral",
            "--scene-camera",
            "--passes",
            "depth,position",
        ]
        for words in (
            [*build, "--resolution", str(given.resolution), "--out", dataset],
            ["verify", dataset, "--deep", str(given.deep)],
        ):
            subprocess.run(python_command("generator.cli", *words), check=True)


if __name__ == "__main__":
    main()
