# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parameters of parametric heads go with what the detector reads off their pitch.

    python benchmarks/detector_causes.py CANONICAL_FACE.csv [--count 600]

Builds neutral heads at pose zero (400 mm, 384 pixels), takes the offset of each as detector_offset.py does,
and fits it by ridge regression (Hoerl and Kennard 1970) on everything that ``head.json`` says of a head.
Printed are the share of the variance that is explained and the strongest parameters: the effect of one
standard deviation, and of one unit. Two or three minutes.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

from generator.geometry.rigid import fit_rotations
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, angles_from_rotation

RIDGE = 20.0
SHOWN = 16
NEGATIVE = ("-decr", "-down", "-backward", "-in", "-concave", "-compress")
POSITIVE = ("-incr", "-up", "-forward", "-out", "-convex", "-uncompress")


def build(out: Path, count: int) -> None:
    """Neutral heads, one image each."""
    command = [sys.executable, "-m", "generator.cli", "build", "--out", str(out), "--count", str(count)]
    command += ["--seed", "31", "--images", "none", "--resolution", "384", "--lens", "400"]
    command += ["--yaw=0,0,1", "--pitch=0,0,1", "--roll=0,0,1"]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


def offsets(dataset: Path, canonical: np.ndarray) -> dict[str, float]:
    """Subject -> pitch that is read at pose zero, degrees."""
    columns = ["subject", "detected", "landmarks"]
    rows = pq.read_table(dataset / "data", columns=columns, partitioning=None).to_pylist()
    model = canonical @ CAMERA_FROM_GRAPHICS
    return {
        row["subject"]: float(angles_from_rotation(fit_rotations(model, points)[0])[1])
        for row in rows
        if row["detected"]
        for points in [np.array(row["landmarks"]).reshape(1, -1, 3)]
    }


def parameters(card: Path) -> dict[str, float]:
    """Numbers of one head: targets with a sign, left and right together; beards and hair as shares."""
    said: dict[str, Any] = json.loads(card.read_text(encoding="utf-8"))["parameters"]
    identity, look = said["identity"], said["appearance"]
    found = {key: value for key, value in {**identity, **look}.items() if isinstance(value, (int, float))}
    found |= {f"ethnicity {key}": share for key, share in identity["ethnicity"].items() if key != "caucasian"}
    for name, weight in identity["targets"].items():
        end = next((end for end in (*NEGATIVE, *POSITIVE) if name.endswith(end)), "")
        both = name.removesuffix(end).replace("/l-", "/").replace("/r-", "/")
        sign = -1.0 if end in NEGATIVE else 1.0
        found[both] = found.get(both, 0.0) + sign * weight
    found[f"beard {look['beard']}"] = look["beard_density"]
    found[f"hair {look['hair_style']}"] = 1.0
    return {key: float(value) for key, value in found.items()}


def main() -> None:
    """Build, fit, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("canonical", type=Path)
    parser.add_argument("--count", type=int, default=600)
    given = parser.parse_args()
    canonical = np.loadtxt(given.canonical, delimiter=",", comments="#")
    with tempfile.TemporaryDirectory() as folder:
        dataset = Path(folder) / "d"
        build(dataset, given.count)
        read = offsets(dataset, canonical)
        heads = {name: parameters(dataset / "heads" / name / "head.json") for name in read}
    names = sorted({name for head in heads.values() for name in head} - {"beard none", "hair short"})
    table = np.array([[head.get(name, 0.0) for name in names] for head in heads.values()])
    read_deg = np.array(list(read.values()))
    spread = table.std(axis=0)
    varies = spread > 1e-9
    table, spread = table[:, varies], spread[varies]
    names = [name for name, one in zip(names, varies, strict=True) if one]
    scaled, off = (table - table.mean(axis=0)) / spread, read_deg - read_deg.mean()
    effect = np.linalg.solve(scaled.T @ scaled + RIDGE * np.eye(len(names)), scaled.T @ off)
    explained = 1 - (off - scaled @ effect).var() / off.var()
    print(
        f"{len(off)} heads: {read_deg.mean():.2f} degrees, sd {off.std(ddof=1):.2f}; "
        f"explained {explained:.2f}"
    )
    for place in np.argsort(-np.abs(effect))[:SHOWN]:
        print(f"{names[place]:32} {effect[place]:6.2f} a sd  {effect[place] / spread[place]:7.2f} a unit")


if __name__ == "__main__":
    main()
