# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of one part."""

from __future__ import annotations

from dataclasses import dataclass

from generator.plan.factors import part_folder


@dataclass(frozen=True)
class PartInfo:
    """One part as the manifest lists it.

    path: relative to the dataset, with "/". bytes and sha256: of the file.
    digest: of the content, see :mod:`generator.dataset.format.digest`.
    subject, expression: "" where the part holds several.
    """

    path: str
    rows: int
    detected: int
    bytes: int
    sha256: str
    digest: str
    subject: str
    expression: str

    @property
    def of_twins(self) -> bool:
        """Does it hold twins of rows?"""
        return self.path.startswith(f"{part_folder('any')}/")
