# SPDX-License-Identifier: GPL-3.0-or-later
"""How fast a build is, against the script one would write first.

    python benchmarks/build.py [--frames 2000]
    python benchmarks/build.py --variety photo [--frames 2000]

In one run, on this machine: a naive script (one process, Principled, 16
samples, denoised, landmarks afterwards), the rate that CPU time allows,
``headturn build`` by every executor, the share of time in each stage, the
resident memory of every process, and the quality preset. With --variety: builds
of that variety and of none by turns, in the same processes, and their resident
memory. Run it on a quiet machine; it prints the load it found.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
from resident import Resident
from results import Figure, write_json

from generator.execution.build.run import build
from generator.execution.executors.open import open_executor
from generator.heads.parametric.make import make_heads
from generator.plan.config import load_config
from generator.process import available_cores

NAIVE = Path(__file__).with_name("naive_script.py")

ROUNDS = 4
"""Turns of each variety that count; one before them does not, in which everything is loaded."""


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

    def event(self, kind: str, facts: dict) -> None:
        """Nothing to remember."""

    @property
    def rate(self) -> float:
        """Images a second of the rendering stage: render, detect and write."""
        return self.frames / (self.ended - self.began)


def timed_build(
    heads: Path, preset: str, executor: str, frames: int, folder: Path, *, memory: bool = False
) -> float:
    """Images a second of a build of frames images of one head; prints stage shares."""
    ranges = {"yaw": [-50, 50], "pitch": [-40, 40], "roll": [-30, 30]}
    config = load_config(
        None,
        {
            "heads": {"source": str(heads)},
            "poses": {"kind": "sobol", "count": frames, **ranges},
            "render": {"preset": preset, "resolution": 256},
        },
    )
    clock, sampler = Clock(), Resident()
    if memory:
        sampler.start()
    with open_executor(executor) as lanes:
        result = build(config, folder, lanes, clock)
    if memory:
        sampler.stop()
        print(sampler.text())
    total = sum(result.seconds.values())
    shares = ", ".join(f"{k} {v / total:.0%}" for k, v in sorted(result.seconds.items(), key=lambda i: -i[1]))
    found = result.manifest.detected_rows / result.manifest.rows
    print(
        f"headturn {preset:8}{executor:8}{clock.rate:6.1f} images/s  ({frames} images, {found:.0%} detected)"
    )
    print(f"  lane time: {shares}", flush=True)
    return clock.rate


def by_turns(heads: Path, variety: str, frames: int, folder: Path) -> None:
    """Images a second of a variety beside none, frames images of one head each in ROUNDS turns.

    Prints the rates, their ratio, and the resident memory of every process while it counted.
    """
    with open_executor("local") as lanes:

        def turn(number: int, name: str, count: int) -> Clock:
            """The seed is another each time, so that no turn has the poses or the looks of another."""
            config = load_config(
                None,
                {
                    "heads": {"source": str(heads)},
                    "poses": {"kind": "sobol", "count": count, "yaw": [-50, 50], "seed": number},
                    "render": {"variety": name, "resolution": 256},
                },
            )
            clock = Clock()
            build(config, folder / f"{name}-{number}", lanes, clock)
            return clock

        names = ("none", variety)
        for name in names:
            turn(0, name, 100)
        sampler = Resident()
        sampler.start()
        clocks: dict[str, list[Clock]] = {name: [] for name in names}
        for number in range(1, ROUNDS + 1):
            for name in names:
                clocks[name].append(turn(number, name, frames // ROUNDS))
        sampler.stop()
    for name, turns in clocks.items():
        each = ", ".join(f"{clock.rate:.1f}" for clock in turns)
        print(f"variety {name:8} {overall(turns):6.1f} images/s  (by turns {each})")
    ratio = overall(clocks[variety]) / overall(clocks["none"])
    print(f"{variety} has {ratio:.0%} of the rate of none; resident memory from the first image to the last")
    print(f"(python is the host, which made {len(names) * (ROUNDS + 1)} builds):")
    print(sampler.text(points=16))


def overall(turns: list[Clock]) -> float:
    """Images a second of some turns together."""
    return sum(clock.frames for clock in turns) / sum(clock.ended - clock.began for clock in turns)


def cpu_limit(heads: Path, folder: Path, frames: int = 200) -> float:
    """Images a second that the CPU time of one lane allows on all cores: nothing waits for anything.

    Measured on one core: what a lane and its render worker use for frames images.
    """
    cores = available_cores()
    os.sched_setaffinity(0, {cores[0]})
    try:
        config = load_config(
            None,
            {
                "heads": {"source": str(heads)},
                "poses": {"kind": "sobol", "count": frames, "yaw": [-50, 50], "pitch": [-40, 40]},
            },
        )
        used: list[float] = []

        class Stamps(Clock):
            def event(self, kind: str, facts: dict) -> None:
                used.append(cpu_seconds())

        with open_executor("serial") as lanes:
            build(config, folder, lanes, Stamps())
    finally:
        os.sched_setaffinity(0, cores)
    # Between the first unit's end and the last one's: without start and loading.
    return len(cores) * (frames - config.dataset.unit_size) / (used[-1] - used[0])


def cpu_seconds() -> float:
    """CPU time of this process and its children."""
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    return sum(sum(process.cpu_times()[:2]) for process in processes)


def main() -> None:
    """Run all and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=2000, help="images of a fast build")
    parser.add_argument("--naive-frames", type=int, default=16)
    parser.add_argument("--executors", default="serial,local,ray", help="which, separated by commas")
    parser.add_argument("--no-quality", action="store_true")
    parser.add_argument("--variety", help="that one beside none, by turns, and nothing else")
    parser.add_argument("--json", type=Path, help="write what was measured, for history.py")
    arguments = parser.parse_args()
    load = os.getloadavg()[0]
    print(f"cores: {len(available_cores())}; load before: {load:.1f}; 256 x 256, one parametric head")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        make_heads(folder / "heads", count=1, seed=0)
        if arguments.variety:
            by_turns(folder / "heads", arguments.variety, arguments.frames, folder)
            return
        [mesh] = (folder / "heads").rglob("neutral.obj")
        command = [sys.executable, str(NAIVE), str(mesh), str(arguments.naive_frames)]
        naive = float(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()[-1])
        print(f"naive script            {naive:6.2f} images/s  ({arguments.naive_frames} images)", flush=True)
        limit = cpu_limit(folder / "heads", folder / "limit")
        print(f"limit by CPU time, fast {limit:6.1f} images/s")
        rates = {
            name: timed_build(
                folder / "heads", "fast", name, arguments.frames, folder / name, memory=name == "local"
            )
            for name in arguments.executors.split(",")
        }
        for name, rate in rates.items():
            print(f"{name:8} {rate / naive:6.1f} x naive, {rate / limit:4.0%} of the limit")
        if {"local", "ray"} <= set(rates):
            print(f"ray's overhead over local: {1 - rates['ray'] / rates['local']:.1%}")
        figures = [Figure("naive script", naive, "images/s")]
        figures += [Figure(f"fast, {name}", rate, "images/s", rate / naive) for name, rate in rates.items()]
        if not arguments.no_quality:
            rate = timed_build(
                folder / "heads", "quality", "local", arguments.frames // 8, folder / "quality"
            )
            print(f"quality  {rate / naive:6.1f} x naive")
            figures.append(Figure("quality, local", rate, "images/s", rate / naive))
        write_json(arguments.json, "build.py", figures)


if __name__ == "__main__":
    main()
