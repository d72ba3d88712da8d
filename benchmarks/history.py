# SPDX-License-Identifier: GPL-3.0-or-later
"""Appends the figures of a release to benchmarks/history.csv, a line each, with the machine.

    python benchmarks/history.py               # runs build.py and latency.py, some minutes on a quiet machine
    python benchmarks/history.py a.json ...    # of what benchmarks wrote with --json

Prints each line beside the last one of the same figure on the same machine.
"""

from __future__ import annotations

import csv
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

FILE = Path(__file__).with_name("history.csv")
COLUMNS = ("date", "version", "commit", "machine", "load", "benchmark", "figure", "value", "unit", "ratio")
BENCHMARKS = ("build.py", "latency.py")


def rows_of(path: Path) -> list[dict[str, Any]]:
    """Lines of a file of figures. SystemExit: it is none."""
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        about = {name: said[name] for name in COLUMNS[:6]}
        return [
            about | {"figure": one["name"], "value": f"{one['value']:.4g}", "unit": one["unit"]}
            | {"ratio": "" if one["ratio"] is None else f"{one['ratio']:.4g}"}
            for one in said["figures"]
        ]  # fmt: skip
    except (OSError, ValueError, KeyError, TypeError) as error:
        sys.exit(f"history.py: {path}: expected what a benchmark writes with --json ({error})")


def history() -> list[dict[str, str]]:
    """What is there already."""
    with FILE.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def append(rows: list[dict[str, Any]]) -> None:
    """Add lines, and print each beside the last of its kind."""
    before = {(row["machine"], row["figure"]): row for row in history()}
    with FILE.open("a", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        for row in rows:
            writer.writerow(row)
            last = before.get((row["machine"], row["figure"]))
            then = f"  ({last['version']}: {last['value']})" if last else ""
            print(f"{row['figure']:40} {row['value']:>8} {row['unit']}{then}")


def measured(folder: Path) -> list[Path]:
    """Files of all benchmarks that belong into a release. SystemExit: one did not measure anything.

    One that ends with 1 measured what was too slow, and that belongs into the history, too.
    """
    files = []
    for name in BENCHMARKS:
        files.append(folder / f"{name}.json")
        subprocess.run([sys.executable, FILE.with_name(name), "--json", files[-1]], check=False)
        if not files[-1].exists():
            sys.exit(f"history.py: {name} wrote no figures")
    return files


def main() -> None:
    """Command line."""
    with tempfile.TemporaryDirectory() as folder:
        files = list(map(Path, sys.argv[1:])) or measured(Path(folder))
        append([row for file in files for row in rows_of(file)])


if __name__ == "__main__":
    main()
