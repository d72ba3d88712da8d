# SPDX-License-Identifier: GPL-3.0-or-later
"""The extension's two speeds in a real Blender, in one run: slider to redraw, and start-up.

    python benchmarks/addon.py [--blender PATH]

Needs what scripts/real_blender.sh sets up. The head is as large as FaceScape's (26,317
vertices); it is a sphere with a face's size, because no such head may be shipped.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import save_package

ROOT = Path(__file__).resolve().parents[1]
VERTICES = 26_317
STARTS = 7
COUNT = 20


def sphere(count: int) -> HeadMesh:
    """About count vertices on rings around an ellipsoid of a head's size."""
    rings = round(np.sqrt(count / 2))
    around = -(-count // rings)
    theta = np.linspace(0.02, np.pi - 0.02, rings)[:, None]
    phi = np.linspace(0, 2 * np.pi, around, endpoint=False)[None]
    points = np.stack(
        [80 * np.sin(theta) * np.cos(phi), 120 * np.cos(theta) + 0 * phi, 95 * np.sin(theta) * np.sin(phi)],
        -1,
    )
    row, column = np.meshgrid(np.arange(rings - 1), np.arange(around), indexing="ij")
    a, b = row * around + column, row * around + (column + 1) % around
    quads = np.stack([a, b, b + around, a + around], -1).reshape(-1, 4)
    triangles = np.concatenate([quads[:, [0, 2, 1]], quads[:, [0, 3, 2]]]).astype(np.int32)
    index = np.zeros(len(triangles), dtype=np.int32)
    return HeadMesh(points.reshape(-1, 3), triangles, None, None, index, (Material("skin"),))


def main() -> None:
    """Print the figures as a table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--blender", type=Path, default=Path("/opt/headturn-blender/blender-trixie"))
    blender = parser.parse_args().blender
    runner = blender.with_name(blender.name.replace("blender-", "run-"))
    with tempfile.TemporaryDirectory(prefix="headturn-bench-") as name:
        folder = Path(name)
        environments = {}
        for kind in ("without", "with"):
            (folder / kind).mkdir()
            environments[kind] = {**os.environ, "BLENDER_USER_RESOURCES": str(folder / kind)}
        script = [sys.executable, str(ROOT / "scripts" / "build_extension.py"), "--out", name]
        package = subprocess.run(script, check=True, capture_output=True, text=True).stdout.strip()
        install = ["--command", "extension", "install-file", "-r", "user_default", "-e", package]
        subprocess.run([str(blender), *install], env=environments["with"], check=True, capture_output=True)

        starts: dict[str, list[float]] = {"without": [], "with": []}
        for _ in range(STARTS):  # in turn, so that a change in the machine's load hits both
            for kind, times in starts.items():
                began = time.perf_counter()
                quit_at_once = [str(blender), "--background", "--python-expr", "import os; os._exit(0)"]
                subprocess.run(quit_at_once, env=environments[kind], check=True, capture_output=True)
                times.append(time.perf_counter() - began)

        save_package(sphere(VERTICES), folder / "head.npz")
        said: dict[str, float] = {}
        for kind, environment in [("plain", "without"), ("slider", "with")] * 2:
            facts = in_window(kind, folder, runner, environments[environment])
            # Twice, in turn: the better of the two is the less disturbed.
            said |= {name: min(value, said.get(name, value)) for name, value in facts.items()}
    for kind, times in starts.items():
        low, middle, high = np.percentile(times, [0, 50, 100])
        print(f"start-up {kind:8} the extension: {middle:.3f} s (median of {STARTS}; {low:.3f}-{high:.3f})")
    vertices = said.pop("vertices")
    print(f"a head of {vertices:.0f} vertices, medians of {COUNT} changes, milliseconds:")
    for name, value in said.items():
        print(f"  {value:8.2f}  {name}")


def in_window(kind: str, folder: Path, runner: Path, environment: dict[str, str]) -> dict[str, float]:
    """Run addon_view.py in a Blender with a window; what it measured."""
    out, script = folder / "facts.json", Path(__file__).with_name("addon_view.py")
    screen = ["xvfb-run", "-a", "-s", "-screen 0 1280x720x24 +extension GLX"]
    flags = ["--window-geometry", "0", "0", "1280", "720", "--python", str(script), "--"]
    command = [str(runner), *screen, "blender", *flags, kind, str(folder / "head.npz"), str(out), str(COUNT)]
    done = subprocess.run(command, env=environment, check=False, capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stdout + done.stderr)
    facts: dict[str, float] = json.loads(out.read_text(encoding="utf-8"))
    return facts


if __name__ == "__main__":
    main()
