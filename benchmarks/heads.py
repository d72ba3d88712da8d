# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head costs: making it, placing it, and a dataset of many heads at few poses.

    python benchmarks/heads.py [--heads 300] [--poses 10] [--against b54db70] [--against-heads 20]

One ``headturn build`` of parametric heads with one expression each into a new folder, by this checkout and by
another commit beside it, at the default size and preset. Printed of each are heads made a second, expressions
placed a second, with the start of the lanes and without, images a second from the command's start to its end,
CPU time, and the memory that all its processes have at most, in which pages that they share count each time.
Every stage is from its announcement to its last step. Run it on a quiet machine; it prints the load it found.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

from checkout import HERE, build_events, other_checkout
from resident import Resident

RANGES = ("--yaw=-50,50", "--pitch=-40,40", "--roll=-30,30")


@dataclass
class Stage:
    """When a stage began, and when so many of its steps were done."""

    began: float
    steps: list[tuple[float, int]] = field(default_factory=list)

    def rate(self) -> float:
        """Steps a second."""
        return self.steps[-1][1] / (self.steps[-1][0] - self.began) if self.steps else 0.0

    def running(self) -> float:
        """Steps a second from the first that were told to the last; as a whole if all were told at once."""
        (first, some), (last, most) = self.steps[0], self.steps[-1]
        return (most - some) / (last - first) if most > some else self.rate()


@dataclass
class Cost:
    """Of a build: rates a second, seconds of CPU time an image, MiB."""

    making: float
    placing: float
    placing_running: float
    images: float
    cpu_s: float
    memory: float
    detected: float


def measure(checkout: Path, heads: int, poses: int, seed: int, folder: Path) -> Cost:
    """Build heads of a seed in a new folder."""
    out = folder / "dataset"
    options = ["--count", str(heads), "--seed", str(seed), "--sampled-expressions", "0"]
    stages: dict[str, Stage] = {}
    samplers: list[Resident] = []

    def watch(pid: int) -> None:
        samplers.append(Resident(pid))
        samplers[0].start()

    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = time.perf_counter()
    events = build_events(checkout, [*options, "--poses", f"uniform:{poses}", *RANGES], out, watch)
    for when, event in events:
        if event["event"] == "stage":
            stages[event["stage"]] = Stage(when)
        elif event["event"] == "progress":
            stages[event["stage"]].steps.append((when, event["done"]))
    seconds = time.perf_counter() - began
    samplers[0].stop()
    now = resource.getrusage(resource.RUSAGE_CHILDREN)
    manifest = json.loads((out / "manifest.json").read_text())
    if manifest["rows"] != heads * poses:
        raise SystemExit(f"{checkout}: {manifest['rows']} images of {heads} heads at {poses} poses")
    placing = stages["placing heads"]
    if (first := stages.get("looking at the first heads")) is not None:
        # Each is placed then, and only told again afterwards.
        told = max((done for _, done in first.steps), default=0)
        again = [(when, done) for when, done in placing.steps if done > told]
        placing = Stage(first.began, [*first.steps, *again])
    return Cost(
        making=stages["making heads"].rate(),
        placing=placing.rate(),
        placing_running=placing.running(),
        images=manifest["rows"] / seconds,
        cpu_s=(now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime) / manifest["rows"],
        memory=samplers[0].most,
        detected=manifest["detected_rows"] / manifest["rows"],
    )


def main() -> None:
    """Measure both and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--heads", type=int, default=300, help="of this checkout's build")
    parser.add_argument("--poses", type=int, default=10, help="of each head")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--against", default="b54db70", help="another commit; none for no other")
    parser.add_argument("--against-heads", type=int, default=20, help="of its build, which is slow")
    parser.add_argument("--folder", type=Path, help="where to build; default the temporary folder")
    arguments = parser.parse_args()
    cores = len(os.sched_getaffinity(0))
    print(f"cores: {cores}; load before: {os.getloadavg()[0]:.1f}; {arguments.poses} poses a head")
    costs: dict[str, Cost] = {}

    def report(name: str, checkout: Path, heads: int, folder: Path) -> None:
        folder.mkdir()
        cost = costs[name] = measure(checkout, heads, arguments.poses, arguments.seed, folder)
        print(
            f"{name:8}{heads:5} heads  made {cost.making:5.2f}/s  placed {cost.placing:5.2f}/s "
            f"({cost.placing_running:.2f} without the lanes' start)  {cost.images:5.2f} images/s all in  "
            f"{cost.cpu_s:.3f} s of CPU an image  {cost.memory:.0f} MiB  {cost.detected:.0%} detected",
            flush=True,
        )

    with tempfile.TemporaryDirectory(dir=arguments.folder) as temporary:
        folder = Path(temporary)
        if arguments.against != "none":
            with other_checkout(arguments.against, folder / "checkout") as other:
                report(arguments.against[:8], other, arguments.against_heads, folder / "other")
        report("this", HERE, arguments.heads, folder / "this")
    if len(costs) == 2:
        old, new = costs.values()
        print(
            f"this / {next(iter(costs))}: making {new.making / old.making:.1f}, placing "
            f"{new.placing / old.placing:.1f}, images all in {new.images / old.images:.1f}, "
            f"CPU time an image {new.cpu_s / old.cpu_s:.2f}, memory {new.memory / old.memory:.2f}"
        )


if __name__ == "__main__":
    main()
