# SPDX-License-Identifier: MIT
"""What confidence says of faces that wear something, or of which something is hidden, beside what comes true.

    headturn build --count 24 --poses sobol:6 --variety photo --mask choice:none,medical,cloth,ffp2 --out worn
    python scripts/worn.py worn [DATASET ...] [--model pose.onnx]

A row of the table a kind of thing that heads wear, which renders know (``look_...`` of their tables); then
confidence in five bins. The labels are exact.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from downstream_hpe.cli.console import one_line_errors, say
from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.reliability import reliability
from downstream_hpe.geometry.metrics import SURE_DEG, euler_errors, geodesic_errors
from downstream_hpe.geometry.rotation import angles_from_rotation
from downstream_hpe.prediction.plausibility import FaceShapes
from downstream_hpe.prediction.predictor import DEFAULT_MODEL, Predictor
from downstream_hpe.tables.columns import WORN, column
from downstream_hpe.tables.open import open_tables
from downstream_hpe.tables.rows import Rows, read_rows

NOTHING = ("none", "own")
"""Styles that are no thing."""
BINS = np.linspace(0, 1, 6)
HEADER = f"""\
| | faces | pitch | geodesic | below {SURE_DEG:g}° | confidence | plausibility |
| --- | ---: | ---: | ---: | ---: | ---: | ---: |"""


def looks(dataset: Path) -> dict[str, np.ndarray]:
    """The style of each of WORN, str [N], of each detected row, in the order of :func:`read_rows`.

    DataError: a table without these columns.
    """
    columns = ["detected", *(f"look_{kind}" for kind in WORN)]
    found: dict[str, list[np.ndarray]] = {kind: [] for kind in WORN}
    for batch in open_tables(dataset, columns).batches(columns):
        detected = column(batch, "detected")
        for kind in WORN:
            found[kind].append(np.array(batch.column(f"look_{kind}").to_pylist())[detected])
    return {name: np.concatenate(parts) for name, parts in found.items()}


def groups(worn: dict[str, np.ndarray]) -> Iterator[tuple[str, np.ndarray]]:
    """Name and rows, bool [N], of each line of the table."""
    things = {kind: ~np.isin(styles, NOTHING) for kind, styles in worn.items()}
    some = np.any(list(things.values()), axis=0)
    yield "all", np.ones(len(some), dtype=bool)
    yield "none of these", ~some
    yield from things.items()


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("datasets", type=Path, nargs="+")
    parser.add_argument("--model", default=DEFAULT_MODEL, help="a model's name, its folder or an .onnx file")
    given = parser.parse_args()
    with one_line_errors():
        parts = [looks(dataset) for dataset in given.datasets]
        worn = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
        rows = Rows.joined([read_rows(dataset) for dataset in given.datasets])
        for line in report(rows, worn, Predictor.load(given.model)):
            say(line)


def report(rows: Rows, worn: dict[str, np.ndarray], predictor: Predictor) -> list[str]:
    """Both tables. DataError: the model gives no confidence."""
    pose = predictor.from_landmarks(rows.landmarks)
    if pose.confidence is None:
        raise DataError("the model gives no confidence")
    plausible = FaceShapes.load().plausibility(rows.landmarks.astype(np.float64))
    errors = geodesic_errors(pose.rotation, rows.rotation)
    pitch = euler_errors(pose.ypr_deg, angles_from_rotation(rows.rotation))[:, 1]
    lines = HEADER.splitlines()
    for name, mine in groups(worn):
        if mine.any():
            below = (errors[mine] < SURE_DEG).mean()
            means = (pitch[mine].mean(), errors[mine].mean(), below)
            said = (pose.confidence[mine].mean(), plausible[mine].mean())
            cells = [name, str(mine.sum()), *(f"{value:.2f}" for value in (*means, *said))]
            lines.append(f"| {' | '.join(cells)} |")
    return [*lines, "", *reliability(pose.confidence, errors, BINS.tolist()).splitlines()]


if __name__ == "__main__":
    main()
