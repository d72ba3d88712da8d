# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast a build is, against the script one would write first.

    python benchmarks/build.py [--frames 2000]

In one run, on this machine: a naive script (one process, Principled, 16
samples, denoised, landmarks afterwards), ``headturn build`` fast and quality,
the share of time in each stage, and the resident memory of every process.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import psutil

from generator.execution.build import build
from generator.execution.executor import available_cores
from generator.execution.open_executor import open_executor
from generator.heads.parametric.make import make_heads
from generator.plan.config import load_config

NAIVE = Path(__file__).with_name("naive_script.py")


class Clock:
    """A build's reporter that only remembers when the rendering stage began and ended."""

    def __init__(self) -> None:
        self.began = self.ended = 0.0
        self.frames = 0
        self.rendering = False

    def stage(self, name: str, total: int) -> None:
        self.rendering = name == "rendering"
        if self.rendering:
            self.began = time.perf_counter()

    def advance(self, steps: int = 1) -> None:
        if self.rendering:
            self.frames += steps
            self.ended = time.perf_counter()

    def note(self, text: str) -> None:
        print("  note:", text)

    @property
    def rate(self) -> float:
        """Images a second of the rendering stage: render, detect and write."""
        return self.frames / (self.ended - self.began)


class Memory(threading.Thread):
    """Samples the resident memory of this process's children."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.samples: dict[tuple[int, str], list[int]] = {}
        self._stop_now = threading.Event()

    def run(self) -> None:
        """Sample four times a second."""
        while not self._stop_now.wait(0.25):
            for child in psutil.Process().children(recursive=True):
                try:
                    words = child.cmdline()
                    kind = next((w for w in words if w.startswith("generator.")), Path(words[0]).name)
                    self.samples.setdefault((child.pid, kind), []).append(child.memory_info().rss)
                except (psutil.NoSuchProcess, psutil.ZombieProcess, IndexError):
                    continue  # it ended between being listed and being asked

    def stop(self) -> None:
        """Stop and print peak, and growth over the second half of each process's life."""
        self._stop_now.set()
        self.join()
        for (_, kind), values in sorted(self.samples.items(), key=lambda item: item[0][1]):
            if len(values) < 8:
                continue
            half = len(values) // 2
            growth = (values[-1] - values[half]) / 2**20
            peak = max(values) / 2**20
            print(f"  {kind:32} peak {peak:5.0f} MiB, growth over the second half {growth:+.1f} MiB")


def timed_build(heads: Path, preset: str, frames: int, folder: Path, memory: bool) -> float:
    """Images a second of a build of frames images of one head; prints stage shares."""
    config = load_config(
        None,
        {
            "heads": {"source": str(heads)},
            "poses": {
                "kind": "sobol",
                "count": frames,
                "yaw": [-50, 50],
                "pitch": [-40, 40],
                "roll": [-30, 30],
            },
            "render": {"preset": preset, "resolution": 256},
        },
    )
    clock, sampler = Clock(), Memory()
    if memory:
        sampler.start()
    with open_executor("local") as lanes:
        result = build(config, folder, lanes, clock)
    if memory:
        sampler.stop()
    total = sum(result.seconds.values())
    shares = ", ".join(f"{k} {v / total:.0%}" for k, v in sorted(result.seconds.items(), key=lambda i: -i[1]))
    found = result.manifest.detected_rows / result.manifest.rows
    print(f"headturn {preset:8} {clock.rate:6.1f} images/s  ({frames} images, {found:.0%} detected)")
    print(f"  lane time: {shares}")
    return clock.rate


def main() -> None:
    """Run all and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=2000, help="images of the fast build")
    parser.add_argument("--naive-frames", type=int, default=16)
    arguments = parser.parse_args()
    print(f"cores: {len(available_cores())}; 256 x 256, one parametric head")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        make_heads(folder / "heads", count=1, seed=0)
        [mesh] = (folder / "heads").rglob("neutral.obj")
        command = [sys.executable, str(NAIVE), str(mesh), str(arguments.naive_frames)]
        naive = float(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()[-1])
        print(f"naive script      {naive:6.2f} images/s  ({arguments.naive_frames} images)")
        fast = timed_build(folder / "heads", "fast", arguments.frames, folder / "fast", memory=True)
        quality = timed_build(
            folder / "heads", "quality", arguments.frames // 8, folder / "quality", memory=False
        )
        print(f"ratio to the naive script: fast {fast / naive:.1f}x, quality {quality / naive:.1f}x")


if __name__ == "__main__":
    main()
