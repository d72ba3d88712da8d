# SPDX-License-Identifier: GPL-3.0-or-later
"""What a very large build costs besides rendering: time and memory of everything else.

    python benchmarks/scale.py [--units 10000] [--rows 700] [--folder DIR]

Runs the real build with an executor that renders nothing: its parts come from
the real writer, with images left out and the same landmarks in every row, so
that seven million rows fit on a disk. Then the resume scan, a second build that
finds everything there, and verify. Prints seconds and this process's memory.
"""

from __future__ import annotations

import argparse
import os
import shutil
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from generator.dataset.format.part import UnitRows, commit_unit
from generator.dataset.format.schema import part_schema
from generator.dataset.proof.verify import verify_dataset
from generator.execution.build.receipts import Receipts, split_done
from generator.execution.build.run import build
from generator.execution.lanes.slot import Outcome
from generator.geometry.camera import Camera
from generator.landmarks.anchors import no_anchors
from generator.landmarks.detector import POINTS
from generator.placing.face import Prepared
from generator.plan.config import load_config
from generator.process import resident_mib

VERSIONS = {"headturn": "0", "blender": "none"}
MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


class NoRenderer:
    """An executor whose images cost nothing. orders: every build order it was given."""

    name, workers = "none", 1

    def __init__(self) -> None:
        self.orders: list[dict[str, Any]] = []

    def run(self, orders: Sequence[dict[str, Any]], on_frame: Any) -> Iterator[Outcome]:
        """See generator.execution.executors.executor.Executor."""
        receipts = {"versions": self._versions, "prepare": self._prepare, "build": self._build}
        for order in orders:
            yield Outcome(order, receipts[order["op"]](order))

    def close(self) -> None:
        """Nothing was started."""

    def _versions(self, order: dict[str, Any]) -> dict[str, Any]:
        return {"versions": VERSIONS}

    def _prepare(self, order: dict[str, Any]) -> dict[str, Any]:
        prepared = Prepared("mm", 1.0, "+Y", "+Z", (0.0, 0.0, 0.0), 120.0, 90.0)
        facts = {"vertices": 3, "triangles": 1, "problems": [], "anchors": no_anchors().as_dict()}
        return {"prepared": prepared.as_dict(), "facts": [facts] * len(order["heads"]), "versions": VERSIONS}

    def _build(self, order: dict[str, Any]) -> dict[str, Any]:
        self.orders.append(order)
        count, head = len(order["poses"]), order["head"]
        rows = UnitRows(
            subject=head["subject"],
            expression=head["expression"],
            split=order["split"],
            head_license=head["license"],
            redistributable=head["redistributable"],
            angles_deg=np.array(order["poses"]),
            indices=np.array(order["indices"], dtype=np.int16),
            cameras=(Camera(256, 85.0, order["distance_mm"]),),
            detected=np.ones(count, dtype=bool),
            landmarks=np.full((count, POINTS, 3), 128.0, dtype=np.float32),
            anchors=np.full((POINTS, 3), np.nan),
            visible=np.zeros((count, POINTS), dtype=bool),
            images=[b""] * count,
        )
        schema = part_schema(order["images"], VERSIONS, order["configuration_digest"])
        part = commit_unit(rows, schema, Path(order["root"]), order["unit"])
        return {"part": asdict(part), "seconds": {}, "versions": VERSIONS}


class Quiet:
    """A reporter that only remembers when each stage began."""

    def __init__(self) -> None:
        self.began: dict[str, float] = {}

    def stage(self, name: str, total: int) -> None:
        """Note the time."""
        self.began[name] = time.perf_counter()

    def advance(self, steps: int = 1) -> None:
        """Nothing to show."""

    def note(self, text: str) -> None:
        """Nothing to show."""

    def event(self, kind: str, facts: dict[str, Any]) -> None:
        """Nothing to show."""


@contextmanager
def measured(what: str) -> Iterator[None]:
    """Print the seconds a block took and what memory there is after it."""
    start = time.perf_counter()
    yield
    spent = time.perf_counter() - start
    print(f"{what:52} {spent:8.2f} s   {resident_mib(os.getpid()):6.0f} MiB", flush=True)


def make_heads(folder: Path, count: int) -> None:
    """Folders of one triangle each: nothing looks at them."""
    for number in range(count):
        head = folder / f"h{number:05d}" / "neutral.obj"
        head.parent.mkdir(parents=True)
        head.write_text(MESH)


def main() -> None:
    """Build, scan, build again, verify."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=10_000)
    parser.add_argument("--rows", type=int, default=700, help="rows of a unit")
    parser.add_argument("--folder", type=Path, help="where; removed afterwards (default: a temporary folder)")
    parser.add_argument("--no-verify", action="store_true")
    arguments = parser.parse_args()
    chunks = 10
    heads = max(1, arguments.units // chunks)
    folder = Path(tempfile.mkdtemp(dir=arguments.folder))
    try:
        make_heads(folder / "heads", heads)
        config = load_config(
            None,
            {
                "heads": {"source": str(folder / "heads"), "units": "mm", "up": "+Y", "forward": "+Z"},
                "poses": {"kind": "uniform", "count": chunks * arguments.rows, "yaw": [-50, 50],
                          "pitch": [-40, 40], "roll": [-30, 30]},
                "dataset": {"images": "none", "unit_size": arguments.rows},
            },
        )  # fmt: skip
        root, executor = folder / "dataset", NoRenderer()
        print(f"{heads * chunks} units of {arguments.rows} rows: {heads * chunks * arguments.rows:,} rows")
        with measured("first build, without rendering"):
            build(config, root, executor, Quiet())
        with measured("resume scan"):
            done, todo = split_done(executor.orders, Receipts(root))
        assert len(done) == heads * chunks and not todo
        quiet = Quiet()
        with measured("second build: plan, scan, tables, picture, manifest"):
            build(config, root, executor, quiet)
        planned = quiet.began["rendering"] - quiet.began["placing heads"]
        print(f"{'  of that heads, plan and scan':52} {planned:8.2f} s")
        with measured("verify --quick"):
            report = verify_dataset(root, quick=True)
        assert report.ok, report.text()
        if not arguments.no_verify:
            with measured("verify, every byte"):
                report = verify_dataset(root)
            assert report.ok, report.text()
    finally:
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
