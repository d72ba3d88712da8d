# SPDX-License-Identifier: GPL-3.0-or-later
"""The gate: what may not be published does not leave in an export that is for publication."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow.compute as pc

from generator.dataset.export.options import OVERRIDE, ExportOptions
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import read_rows
from generator.errors import UsageError

NAMED = 5
"""Subjects that a refusal names; the rest are counted."""


@dataclass(frozen=True)
class Withheld:
    """Subjects and rows that may not be published. subjects: sorted."""

    subjects: tuple[str, ...]
    rows: int

    @property
    def names(self) -> str:
        """The first few subjects, and how many more there are."""
        more = f" and {len(self.subjects) - NAMED} more" if len(self.subjects) > NAMED else ""
        return ", ".join(self.subjects[:NAMED]) + more


def withheld(root: Path, manifest: Manifest) -> Withheld:
    """What rows say with redistributable = false. Raises DatasetError: a part is missing or damaged."""
    subjects: set[str] = set()
    rows = 0
    columns = ["subject", "redistributable"]
    for batch in read_rows(root, manifest.parts, columns, ~pc.field("redistributable")):
        subjects.update(pc.unique(batch.column("subject")).to_pylist())
        rows += len(batch)
    return Withheld(tuple(sorted(subjects)), rows)


def check_licences(
    root: Path, manifest: Manifest, heads: Sequence[HeadRow], options: ExportOptions, for_publication: bool
) -> tuple[list[HeadRow], Withheld]:
    """The heads that are exported, and what the dataset holds that may not be published.

    for_publication: the format is meant for it, or --public was given.

    Raises
    ------
    UsageError: rows may not be published, and neither a filter nor the override
        was given; or the filter leaves nothing.
    """
    kept = withheld(root, manifest)
    if not kept.rows:
        return list(heads), kept
    if options.only_redistributable:
        left = [head for head in heads if head.redistributable]
        if not left or kept.rows == manifest.rows:
            raise UsageError(
                f"{root}: no row may be published ({kept.names}), so --only-redistributable leaves nothing"
            )
        return left, kept
    if for_publication and not options.may_publish:
        total = len(np.unique([head.subject for head in heads]))
        raise UsageError(
            f"{root}: {kept.rows} of {manifest.rows} rows, of {len(kept.subjects)} of {total} subjects, may "
            f"not be published: {kept.names}; leave them out with --only-redistributable, or say {OVERRIDE} "
            "if their licence allows you to"
        )
    return list(heads), kept
