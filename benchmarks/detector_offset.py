# SPDX-License-Identifier: GPL-3.0-or-later
"""What the detector reads off heads whose pose is known: a meter of how real their faces are shaped.

    python benchmarks/detector_offset.py CANONICAL_FACE.csv                     # 24 parametric heads
    python benchmarks/detector_offset.py CANONICAL_FACE.csv --heads FOLDER      # any source
    python benchmarks/detector_offset.py CANONICAL_FACE.csv --dataset DATASET   # one that was built

CANONICAL_FACE.csv: MediaPipe's canonical face, 468 lines of x, y, z, frame U (Apache-2.0). It is fitted to
the landmarks of every row, scale free; the offset is its pitch less the label's, at pitch -20, 0 and 20,
seen level from afar (400 mm) with pose zero where the mesh's own axes have it. Scans of real people read
-1.2, -1.3 and 0.7 degrees. No label of a photograph is needed, and none is used.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq

from generator.geometry.rigid import fit_rotations
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, angles_from_rotation

PITCHES = (-20, 0, 20)


def build(out: Path, heads: str | None, count: int, seed: int) -> None:
    """A dataset of all heads of a source, or of parametric ones, at the pitches of the meter."""
    command = [sys.executable, "-m", "generator.cli", "build", "--out", str(out), "--images", "none"]
    command += ["--resolution", "384", "--lens", "400", "--preset", "fast", "--frame", "source"]
    command += ["--yaw=0,0,1", "--pitch=-20,20,20", "--roll=0,0,1"]
    command += ["--heads", heads] if heads else ["--count", str(count), "--seed", str(seed)]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def offsets(dataset: Path, canonical: np.ndarray) -> dict[str, np.ndarray]:
    """Head -> pitch that was detected less the label's, degrees, one a pitch; NaN without a face.

    canonical: float [468, 3], frame U.
    """
    columns = ["subject", "expression", "pitch_deg", "detected", "landmarks"]
    rows = pq.read_table(dataset / "data", columns=columns, partitioning=None).to_pylist()
    found: dict[str, np.ndarray] = {}
    for row in rows:
        line = found.setdefault(f"{row['subject']}/{row['expression']}", np.full(len(PITCHES), np.nan))
        if row["detected"] and round(row["pitch_deg"]) in PITCHES:
            points = np.array(row["landmarks"]).reshape(1, -1, 3)
            [seen] = fit_rotations(canonical @ CAMERA_FROM_GRAPHICS, points)
            line[PITCHES.index(round(row["pitch_deg"]))] = angles_from_rotation(seen)[1] - row["pitch_deg"]
    return found


def main() -> None:
    """Build unless built, fit, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("canonical", type=Path)
    parser.add_argument("--heads", help="a head source; parametric heads by default")
    parser.add_argument("--dataset", type=Path, help="an existing dataset at yaw and roll 0 instead")
    parser.add_argument("--count", type=int, default=24)
    parser.add_argument("--seed", type=int, default=77)
    given = parser.parse_args()
    canonical = np.loadtxt(given.canonical, delimiter=",", comments="#")
    with tempfile.TemporaryDirectory() as folder:
        dataset = given.dataset or Path(folder) / "meter"
        if given.dataset is None:
            build(dataset, given.heads, given.count, given.seed)
        found = np.array(list(offsets(dataset, canonical).values()))
    for pitch, line in zip(PITCHES, found.T, strict=True):
        seen = line[np.isfinite(line)]
        print(f"pitch {pitch:4d}: {seen.mean():6.2f} on average, {seen.std(ddof=1):.2f} from head to head")
    mean = np.nanmean(found, axis=0)
    print(f"change from {PITCHES[0]} to {PITCHES[-1]}: {mean[-1] - mean[0]:.2f}; {len(found)} heads")


if __name__ == "__main__":
    main()
