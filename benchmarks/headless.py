# SPDX-License-Identifier: GPL-3.0-or-later
"""One head at the 693 poses of the paper: `headturn build` against `blender --command headturn build`.

    python benchmarks/headless.py [--blender PATH] [--resolution 128]

Compares both datasets: the digest, the bytes of every part and image, every column of every row.
Needs what scripts/real_blender.sh sets up. Ends with 1 if anything differs.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pyarrow.parquet as pq

from generator.dataset.format.files import file_sha256
from generator.dataset.format.manifest import read_manifest

ROOT = Path(__file__).resolve().parents[1]
COMMAND = ("--background", "--command", "headturn")


def main() -> None:
    """Build twice, compare, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--blender", type=Path, default=Path("/opt/headturn-blender/blender-trixie"))
    parser.add_argument("--resolution", type=int, default=128)
    given = parser.parse_args()
    blender = str(given.blender)
    with tempfile.TemporaryDirectory(prefix="headturn-headless-") as name:
        folder = Path(name)
        (folder / "profile").mkdir()
        config, python = folder / "one.toml", folder / "python"
        config.write_text(f"[heads]\ncount = 1\nseed = 1\n[render]\nresolution = {given.resolution}\n")
        run([str(ROOT / "scripts" / "host_python.sh"), sys.executable, str(python)])
        script = str(ROOT / "scripts" / "build_extension.py")
        package = run([sys.executable, script, "--out", name]).strip()
        environment = {"BLENDER_USER_RESOURCES": str(folder / "profile"), "HEADTURN_PYTHON": str(python)}
        install = ["--command", "extension", "install-file", "-r", "user_default", "-e", package]
        run([blender, *install], environment)
        version = run([blender, "--version"]).splitlines()[0]
        ways = {
            "headturn build": [sys.executable, "-m", "generator.cli"],
            f"{version} --background --command headturn build": [blender, *COMMAND],
        }
        outs = []
        for way, command in ways.items():
            outs.append(folder / f"out{len(outs)}")
            began = time.perf_counter()
            run([*command, "build", str(config), "--out", str(outs[-1])], environment)
            manifest = read_manifest(outs[-1])
            print(f"{way}: {manifest.rows} rows in {time.perf_counter() - began:.0f} s")
            print(f"  digest {manifest.digest}", flush=True)
        differences = compare(*outs)
    print("\n".join(differences) or "no difference")
    sys.exit(bool(differences))


def compare(one: Path, other: Path) -> list[str]:
    """What differs between two datasets: files and columns."""
    found = []
    names = [sorted(p.relative_to(out) for p in out.glob("*/**/*") if p.is_file()) for out in (one, other)]
    data = [[p for p in listed if p.parts[0] in ("data", "images")] for listed in names]
    if data[0] != data[1]:
        found.append(f"other files: {sorted(set(data[0]) ^ set(data[1]))[:3]}")
    for path in set(data[0]) & set(data[1]):
        if file_sha256(one / path) != file_sha256(other / path):
            found.append(f"other bytes: {path}")
    tables = [pq.read_table(out / "data", partitioning=None) for out in (one, other)]
    for column in tables[0].column_names:
        # As bytes: NaN is not equal to itself.
        bytes_of = [
            [buffer and buffer.to_pybytes() for buffer in table.column(column).combine_chunks().buffers()]
            for table in tables
        ]
        if bytes_of[0] != bytes_of[1]:
            found.append(f"other values: column {column}")
    if read_manifest(one).digest != read_manifest(other).digest:
        found.append("another digest")
    print(f"compared: {len(data[0])} files of parts and images, {len(tables[0].column_names)} columns")
    return found


def run(command: list[str], environment: dict[str, str] | None = None) -> str:
    """What it printed; ends with what it said if it fails."""
    env = {**os.environ, "PYTHONPATH": str(ROOT), **(environment or {})}
    done = subprocess.run(command, env=env, check=False, capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stdout + done.stderr)
    return done.stdout


if __name__ == "__main__":
    main()
