# SPDX-License-Identifier: GPL-3.0-or-later
"""A build on the CPU and on a GPU: images a second, and that labels are the same.

    python benchmarks/devices.py [--frames 400] [--devices cpu,gpu]

The same heads and poses in both presets, on each device in turn. Then the rows side by side: every label must
be equal to the bit; of what is read off pixels it says how far apart the landmarks that were found are.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import numpy as np
import pyarrow.dataset as ds
from build import Clock

from generator.execution.build.run import build
from generator.execution.executors.open import open_executor
from generator.execution.lanes.options import CPU, GPU
from generator.heads.parametric.make import make_heads
from generator.plan.config import load_config

SEEN = ("detected", "landmarks", "image_sha256")
"""Columns that come from pixels, which each processor rounds its own way."""


def main() -> None:
    """Build, compare, print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--frames", type=int, default=400, help="images of each build")
    parser.add_argument("--devices", default=f"{CPU},{GPU}")
    given = parser.parse_args()
    devices = given.devices.split(",")
    with tempfile.TemporaryDirectory(prefix="headturn-devices-") as name:
        folder = Path(name)
        make_heads(folder / "heads", count=2, seed=0)
        for preset in ("fast", "quality"):
            tables, rates = [], []
            for number, device in enumerate(devices):
                out = folder / f"{preset}-{number}"
                rates.append(_built(folder / "heads", preset, device, given.frames, out))
                tables.append(ds.dataset(out / "data").to_table().sort_by("sample_id"))
                print(
                    f"{preset:8} {device:5} {rates[-1]:7.1f} images/s ({rates[-1] / rates[0]:.2f}x)",
                    flush=True,
                )
            for device, table in zip(devices[1:], tables[1:], strict=True):
                print(f"{preset:8} {device} against {devices[0]}: {_compared(tables[0], table)}")


def _built(heads: Path, preset: str, device: str, frames: int, out: Path) -> float:
    config = load_config(
        None,
        {
            "heads": {"source": str(heads)},
            "poses": {"kind": "sobol", "count": frames // 2, "yaw": [-50, 50]},
            "render": {"preset": preset},
            "dataset": {"images": "none"},
        },
    )
    clock = Clock()
    with open_executor(device=device) as lanes:
        result = build(config, out, lanes, clock)
    print(f"  Blender {result.manifest.versions['blender']}")
    return clock.rate


def _compared(one, other) -> str:
    labels = [name for name in one.column_names if name not in SEEN]
    differ = [name for name in labels if _bits(one[name]) != _bits(other[name])]
    points = [np.array(table["landmarks"].to_pylist()).reshape(len(table), -1, 3) for table in (one, other)]
    off = np.sqrt(np.nanmean(np.sum((points[0] - points[1])[..., :2] ** 2, axis=-1)))
    same = sum(a == b for a, b in zip(*(t["image_sha256"].to_pylist() for t in (one, other)), strict=True))
    says = f"{len(labels)} columns of labels equal" if not differ else f"DIFFERENT: {', '.join(differ)}"
    return f"{says}; landmarks off by {off:.3f} px (root mean square); {same} of {len(one)} images the same"


def _bits(column) -> list:
    """NaN is equal to itself."""
    return [repr(value) for value in column.to_pylist()]


if __name__ == "__main__":
    main()
