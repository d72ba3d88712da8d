# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole numbers for heads, for formats that name people by number."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from generator.dataset.format.heads_table import HeadRow
from generator.escape import csv_text

IDENTITIES_FILE = "identities.csv"

_NUMBERED = re.compile(r"(?:facescape-)?(0|[1-9][0-9]{0,17})")
"""A subject that is a number, or FaceScape's of one: those are called facescape-<id>."""


def head_numbers(heads: Sequence[HeadRow], keep_numbers: bool) -> dict[tuple[str, str], int]:
    """A number from 1 on for every (subject, expression), in their order.

    keep_numbers: where every subject is a number, or FaceScape's of a number, and has one expression,
        that number is kept.
    """
    names = [(head.subject, head.expression) for head in heads]
    own = [int(found[1]) for subject, _ in names if (found := _NUMBERED.fullmatch(subject))]
    if keep_numbers and len(set(own)) == len(names):
        return dict(zip(names, own, strict=True))
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
