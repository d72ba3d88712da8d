# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole numbers for heads, for formats that name people by number."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from generator.dataset.format.heads_table import HeadRow
from generator.escape import csv_text

IDENTITIES_FILE = "identities.csv"


def head_numbers(heads: Sequence[HeadRow], keep_numbers: bool) -> dict[tuple[str, str], int]:
    """A number from 1 on for every (subject, expression), in their order.

    keep_numbers: where every subject is a number and has one expression, as in
        FaceScape, that number is kept.
    """
    names = [(head.subject, head.expression) for head in heads]
    subjects = [subject for subject, _ in names]
    numeric = all(subject.isdecimal() and str(int(subject)) == subject for subject in subjects)
    if keep_numbers and numeric and len(set(subjects)) == len(subjects):
        return {name: int(name[0]) for name in names}
    return {name: number for number, name in enumerate(names, start=1)}


def write_identities(heads: Sequence[HeadRow], numbers: Mapping[tuple[str, str], int], folder: Path) -> None:
    """identities.csv: which head each number is, its split and licence. Raises OSError.

    Before what a spreadsheet would take for a formula stands '.
    """
    with (folder / IDENTITIES_FILE).open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(("id", "subject", "expression", "split", "license", "redistributable"))
        for head in heads:
            number = numbers[head.subject, head.expression]
            texts = (head.subject, head.expression, head.split, head.license)
            writer.writerow((number, *map(csv_text, texts), head.redistributable))
