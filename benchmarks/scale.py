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
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests" / "execution"))
from no_renderer import NoRenderer, make_heads
from quiet import Quiet

from generator.dataset.proof.verify import verify_dataset
from generator.execution.build.receipts import Receipts, split_done
from generator.execution.build.run import build
from generator.plan.config import load_config
from generator.process import resident_mib


@contextmanager
def measured(what: str) -> Iterator[None]:
    """Print the seconds a block took and what memory there is after it."""
    start = time.perf_counter()
    yield
    spent = time.perf_counter() - start
    print(f"{what:52} {spent:8.2f} s   {resident_mib(os.getpid()):6.0f} MiB", flush=True)


def main() -> None:
    """Build, scan, build again, verify."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=10_000)
    parser.add_argument("--rows", type=int, default=700, help="rows of a unit")
    parser.add_argument("--folder", type=Path, help="where; removed afterwards (default: a temporary folder)")
    parser.add_argument("--same-poses", action="store_true", help="one draw for all heads, not one each")
    parser.add_argument("--no-verify", action="store_true")
    arguments = parser.parse_args()
    chunks = 10
    heads = max(1, arguments.units // chunks)
    folder = Path(tempfile.mkdtemp(dir=arguments.folder))
    try:
        make_heads(folder / "heads", *(f"h{number:05d}" for number in range(heads)))
        config = load_config(
            None,
            {
                "heads": {"source": str(folder / "heads"), "units": "mm", "up": "+Y", "forward": "+Z"},
                "poses": {"kind": "uniform", "count": chunks * arguments.rows, "yaw": [-50, 50],
                          "pitch": [-40, 40], "roll": [-30, 30], "same": arguments.same_poses},
                "dataset": {"images": "none", "unit_size": arguments.rows},
            },
        )  # fmt: skip
        root, executor = folder / "dataset", NoRenderer()
        print(f"{heads * chunks} units of {arguments.rows} rows: {heads * chunks * arguments.rows:,} rows")
        with measured("first build, without rendering"):
            build(config, root, executor, Quiet())
        with measured("resume scan"):
            done, todo = split_done(executor.built, Receipts(root))
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
