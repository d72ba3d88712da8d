# SPDX-License-Identifier: GPL-3.0-or-later
"""This checkout against another: is a build slower, and does it write the same?

    git worktree add ../before REVISION
    python benchmarks/against.py ../before [--rounds 4]

Both build the same grid of one parametric head by ``headturn build``, by turns, so that what else the
machine does falls on both. Printed are images a second of the rendering stage, CPU time of the whole
command, and whether the content digests agree. The ratio is of sums over all rounds.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import tempfile
from collections import defaultdict
from pathlib import Path

from checkout import HERE, build_events

GRID = ("--yaw=-50,50,10", "--pitch=-40,40,10", "--roll=-30,30,10")


def timed_build(checkout: Path, options: list[str], out: Path) -> tuple[float, float, str]:
    """Seconds of the rendering stage, CPU seconds of everything, digest."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    began = ended = 0.0
    for when, event in build_events(checkout, options, out):
        if event["event"] == "stage" and event["stage"] == "rendering":
            began = when
        if event["event"] == "unit":
            ended = when
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return ended - began, cpu, json.loads((out / "manifest.json").read_text())["digest"]


def main() -> None:
    """Build by turns and print the ratios."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("other", type=Path, help="another checkout of this repository")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--executor", default="local")
    arguments = parser.parse_args()
    checkouts = {"other": arguments.other.resolve(), "this": HERE}
    options = ["--count", "1", *GRID, "--executor", arguments.executor]
    wall, cpu, digests = defaultdict(list), defaultdict(list), defaultdict(set)
    print(f"693 images of one head, 256 x 256, {arguments.executor}; load before: {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as temporary:
        for turn in range(arguments.rounds):
            for name in sorted(checkouts, reverse=bool(turn % 2)):
                out = Path(temporary, f"{name}{turn}")
                seconds, used, digest = timed_build(checkouts[name], options, out)
                wall[name].append(seconds)
                cpu[name].append(used)
                digests[name].add(digest)
                print(f"  {name:6}{693 / seconds:6.1f} images/s  {used:6.1f} s of CPU", flush=True)
    print(f"rendering stage: this takes {sum(wall['this']) / sum(wall['other']):.3f} of the other's time")
    print(f"CPU time:        this takes {sum(cpu['this']) / sum(cpu['other']):.3f} of the other's")
    print(f"digests:         {'the same' if digests['this'] == digests['other'] else 'different'}")


if __name__ == "__main__":
    main()
