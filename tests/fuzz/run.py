# SPDX-License-Identifier: GPL-3.0-or-later
"""The fuzzer: every target in a process of its own, one after the other, for a share of the time.

    python tests/fuzz/run.py [TARGET ...] [--seconds 600] [--work .fuzz] [--keep BYTES]

Prints a line a target and ends with 1 if anything was found; findings lie in WORK/findings. What was tried
before is kept in WORK and tried further. --keep: put the smallest inputs that reach something new into
the corpus of the repository, at most so many bytes a target.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE))

from targets import TARGETS, Target  # noqa: E402

SLOWEST_S = 10
RSS_MB = 3000
"""With what the libraries take themselves; child.py sets the limit of a gigabyte."""
STARTS = 6
"""So often is a target started again that was ended by what it found."""


@dataclass
class Tried:
    """What came of one target."""

    executions: int = 0
    edges: int = 0
    corpus: int = 0
    ended: int = 0


def main() -> int:
    """Search, and say what was found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("targets", nargs="*", help=f"all if absent: {' '.join(TARGETS)}")
    parser.add_argument("--seconds", type=float, default=600, help="for all of them together")
    parser.add_argument("--work", type=Path, default=Path(".fuzz"), help="folder of findings and inputs")
    parser.add_argument("--keep", type=int, metavar="BYTES", help="grow the corpus of the repository")
    arguments = parser.parse_args()
    chosen = [TARGETS[name] for name in arguments.targets or TARGETS]
    findings = arguments.work.absolute() / "findings"
    findings.mkdir(parents=True, exist_ok=True)
    share = arguments.seconds / sum(target.weight for target in chosen)
    print(
        f"{'target':<16}{'seconds':>8}{'executions':>12}{'edges':>8}{'corpus':>8}{'findings':>10}", flush=True
    )
    total, executions, began = 0, 0, time.monotonic()
    for target in chosen:
        before = set(_found(findings, target))
        seconds = share * target.weight
        tried = search(target, seconds, arguments.work.absolute(), findings)
        found = [file for file in _found(findings, target) if file not in before or tried.ended]
        total, executions = total + len(found), executions + tried.executions
        cells = f"{seconds:>8.0f}{tried.executions:>12}{tried.edges:>8}{tried.corpus:>8}{len(found):>10}"
        print(f"{target.name:<16}{cells}", flush=True)
        if arguments.keep is not None:
            keep(target, arguments.work.absolute(), arguments.keep)
    minutes = (time.monotonic() - began) / 60
    print(f"{len(chosen)} targets, {executions} executions in {minutes:.1f} minutes: {total} findings")
    for file in sorted(findings.glob("*.txt")):
        print(f"  {file.with_suffix('')}: {file.read_text(encoding='utf-8').splitlines()[0]}")
    return 1 if total else 0


def search(target: Target, seconds: float, work: Path, findings: Path) -> Tried:
    """Let libFuzzer look at one target; start it again if a finding ends it."""
    tried, until = Tried(), time.monotonic() + seconds
    grown = work / "inputs" / target.name
    grown.mkdir(parents=True, exist_ok=True)
    for _ in range(STARTS):
        left = int(until - time.monotonic())
        if left < 1:
            break
        options = [f"-max_total_time={left}", f"-timeout={SLOWEST_S}", f"-rss_limit_mb={RSS_MB}"]
        options += [f"-artifact_prefix={findings / target.name}-", "-print_final_stats=1", "-max_len=100000"]
        done = _child(target, findings, [*options, str(grown), str(target.corpus)])
        for line in done.splitlines():
            if counted := re.search(r"cov: (\d+) .*corp: (\d+)", line):
                tried.edges, tried.corpus = max(tried.edges, int(counted[1])), int(counted[2])
            if counted := re.search(r"stat::number_of_executed_units: +(\d+)", line):
                tried.executions += int(counted[1])
        if "DONE" in done or "Done " in done:
            break
        tried.ended += 1
        print(f"  {target.name} was ended: {_reason(done)}", flush=True)
    return tried


def keep(target: Target, work: Path, limit: int) -> None:
    """The smallest inputs that together reach what the whole corpus does, up to a size."""
    merged = work / "merged" / target.name
    shutil.rmtree(merged, ignore_errors=True)
    merged.mkdir(parents=True)
    for file in target.corpus.iterdir():
        shutil.copy(file, merged)
    known = {file.name for file in merged.iterdir()}
    _child(target, work / "findings", ["-merge=1", str(merged), str(work / "inputs" / target.name)])
    taken = 0
    for file in sorted(merged.iterdir(), key=lambda file: (file.stat().st_size, file.name)):
        taken += file.stat().st_size
        if file.name in known:
            continue
        if taken > limit:
            break
        shutil.copy(file, target.corpus / f"more-{file.name[:10]}")


def _child(target: Target, findings: Path, options: list[str]) -> str:
    command = [sys.executable, str(HERE / "child.py"), target.name, str(findings), *options]
    env = {**os.environ, "MALLOC_ARENA_MAX": "2", "OMP_NUM_THREADS": "1", "ARROW_IO_THREADS": "1"}
    # libFuzzer ends a process without letting it tidy up.
    memory = "/dev/shm" if os.access("/dev/shm", os.W_OK) else None
    with tempfile.TemporaryDirectory(prefix="headturn-fuzz-", dir=memory) as scratch:
        env["HEADTURN_FUZZ_SCRATCH"] = scratch
        done = subprocess.run(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=env, check=False
        )
    return done.stderr.decode(errors="replace")


def _found(findings: Path, target: Target) -> Iterator[Path]:
    pattern = re.compile(rf"{target.name}-([0-9a-f]{{8}}|(crash|timeout|oom|leak|slow-unit)-.*)")
    return (file for file in sorted(findings.iterdir()) if pattern.fullmatch(file.name))


def _reason(said: str) -> str:
    lines = [line for line in said.splitlines() if re.search(r"ERROR|SUMMARY|Error|ALARM", line)]
    return " | ".join(lines[:2]) or (said.splitlines() or ["it said nothing"])[-1]


if __name__ == "__main__":
    sys.exit(main())
