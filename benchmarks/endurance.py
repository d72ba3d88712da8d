# SPDX-License-Identifier: GPL-3.0-or-later
"""A long build killed in the middle: is it the same dataset, and does memory stay flat?

    python benchmarks/endurance.py [--heads 20] [--kill-after 0.5] [--seed 0]

Builds the default grid (693 poses) of some parametric heads twice with
``headturn build``: once undisturbed, sampling the resident memory of every
process, and once with the host killed (SIGKILL) when a share of the images is
there and started again. Verifies both and compares their digests.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil
from resident import Resident

from generator.dataset.format.manifest import read_manifest

HEADTURN = [sys.executable, "-m", "generator.cli"]


def run_build(heads: Path, root: Path, total: int, kill_at: int = 0) -> int:
    """One ``headturn build`` of total images; its exit code. With kill_at: killed after so many.

    Prints the memory of each process while it made them, if it made them all.
    """
    command = [*HEADTURN, "build", "--heads", str(heads), "--out", str(root), "--yes", "--json"]
    start, images = time.perf_counter(), 0
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as host:
        workers: list[psutil.Process] = []
        sampler = Resident(host.pid, every_s=1.0)
        sampler.start()
        assert host.stdout is not None
        for line in host.stdout:
            facts = json.loads(line)
            if facts.get("event") == "unit":
                images += int(facts["poses"])
                if images == total:
                    sampler.stop()  # what follows draws pictures: it is not a frame's memory
                if kill_at and images >= kill_at:
                    workers = psutil.Process(host.pid).children(recursive=True)
                    host.send_signal(signal.SIGKILL)
                    break
        code = host.wait()
        sampler.stop()
    _, alive = psutil.wait_procs(workers, timeout=10)
    seconds = time.perf_counter() - start
    print(f"  exit {code}, {images} images, {seconds:.0f} s, {len(alive)} orphans", flush=True)
    if images == total:
        print(sampler.text(points=24), flush=True)
    return code


def verify(root: Path) -> str:
    """``headturn verify``; the digest it confirmed."""
    start = time.perf_counter()
    done = subprocess.run([*HEADTURN, "verify", str(root)], capture_output=True, text=True, check=False)
    passed = sum(line.startswith("ok ") for line in done.stdout.splitlines())
    seconds = time.perf_counter() - start
    print(f"  verify: exit {done.returncode}, {passed} checks passed, {seconds:.0f} s", flush=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    return read_manifest(root).digest


def main() -> None:
    """Build, build and kill, resume, compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--heads", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kill-after", type=float, default=0.5, help="share of the images")
    parser.add_argument("--folder", type=Path, help="keep the heads and both datasets here")
    arguments = parser.parse_args()
    images = arguments.heads * 693
    print(f"{arguments.heads} heads x 693 poses = {images} images; load before: {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory() as temporary:
        folder = arguments.folder or Path(temporary)
        heads, whole, killed = folder / "heads", folder / "whole", folder / "killed"
        make = ["heads", "make", "--count", str(arguments.heads), "--seed", str(arguments.seed)]
        subprocess.run([*HEADTURN, *make, "--out", str(heads)], stdout=subprocess.DEVNULL, check=True)
        print("undisturbed:", flush=True)
        if run_build(heads, whole, images) != 0:
            raise SystemExit("the undisturbed build failed")
        print("killed in the middle:", flush=True)
        run_build(heads, killed, images, kill_at=int(images * arguments.kill_after))
        print("the same command again:", flush=True)
        if run_build(heads, killed, images) != 0:
            raise SystemExit("the resumed build failed")
        digests = [verify(whole), verify(killed)]
        print(f"digests: {' '.join(digests)}: {'the same' if len(set(digests)) == 1 else 'DIFFERENT'}")
        if len(set(digests)) != 1:
            raise SystemExit(1)


if __name__ == "__main__":
    main()
