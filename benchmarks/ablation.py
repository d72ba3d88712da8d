# SPDX-License-Identifier: GPL-3.0-or-later
"""What eight factors do to the detector and its rigid fit: builds rows with twins, prints a table.

    python benchmarks/ablation.py                         # 60 heads x 8 poses: 480 pairs a factor
    python benchmarks/ablation.py --out DATASET --factors glasses,hair,light,lens
    python benchmarks/ablation.py --out DATASET --predictions MODEL.csv

A DATASET that is there is not built again. A cell: without the factor -> with it: the change, and its 95 %
interval over identities.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from pathlib import Path

from generator.dataset.ablate.ablation import Ablation, ablate_dataset
from generator.dataset.ablate.effects import Effect
from generator.dataset.ablate.predictions import read_predictions
from generator.dataset.format.manifest import MANIFEST_FILE
from generator.dataset.show.column_tables import markdown_table

FACTORS = "glasses,hair,mask,light,lens,backdrop,blur,noise"
SHOWN = {"found": "found, %", "landmarks": "landmarks, %", "geodesic": "pose, °", "pitch": "pitch, °"}


def build(out: Path, heads: int, poses: int, factors: str) -> None:
    """Parametric heads within the poses of photographs, every row with a twin of every factor."""
    command = [sys.executable, "-m", "generator.cli", "build", "--out", str(out), "--count", str(heads)]
    command += ["--poses", f"sobol:{poses}", "--yaw=-50,50", "--pitch=-30,30", "--roll=-20,20"]
    subprocess.run([*command, "--twins", factors], check=True, stdout=subprocess.DEVNULL)


def table(found: Ablation) -> str:
    """A line a factor and estimator; a change is bold where its interval leaves out zero."""
    lines = []
    for one in found.factors:
        for judged in one.judged:
            effects = {effect.measure: effect for effect in judged.effects}
            cells = [_cell(effects[name]) if name in effects else "" for name in SHOWN]
            lines.append([one.factor, judged.estimator, str(one.pairs), str(judged.missed), *cells])
    return markdown_table(("factor", "of", "pairs", "a face missed in", *SHOWN.values()), lines)


def _cell(effect: Effect) -> str:
    bold = "**" * effect.is_sure
    change = f"{bold}{effect.change:+.2f}{bold} [{effect.low:+.2f}, {effect.high:+.2f}]"
    return f"{effect.plain:.2f} → {effect.varied:.2f}: {change}"


def main() -> None:
    """Build unless built, ablate, print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, help="the dataset; by default one that is deleted in the end")
    parser.add_argument("--heads", type=int, default=60)
    parser.add_argument("--poses", type=int, default=8, help="of each head")
    parser.add_argument("--factors", default=FACTORS)
    parser.add_argument("--predictions", type=Path, action="append", default=[], help="of models, repeatable")
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        dataset = given.out or Path(folder) / "dataset"
        if not (dataset / MANIFEST_FILE).exists():
            build(dataset, given.heads, given.poses, given.factors)
        models = [read_predictions(path) for path in given.predictions]
        print(table(ablate_dataset(dataset, models)))


if __name__ == "__main__":
    main()
