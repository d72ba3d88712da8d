# SPDX-License-Identifier: GPL-3.0-or-later
"""What may be chosen about an export."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Landmarks = Literal["auto", "exact", "detected"]
"""Which 468 points: from the mesh, from the detector, or (auto) the mesh's if the dataset has them."""

Missing = Literal["keep", "skip", "exact", "fail"]
"""Rows without what the format needs: kept as they are, left out, filled from the mesh, or refused."""

OVERRIDE = "--i-may-publish-these-heads"


@dataclass(frozen=True)
class ExportOptions:
    """missing = None takes the format's own default.

    public: the export will be published, whatever its format.
    only_redistributable: leave out rows that may not be published.
    may_publish: the person who exports holds the right to publish all of them.
    """

    landmarks: Landmarks = "auto"
    missing: Missing | None = None
    public: bool = False
    only_redistributable: bool = False
    may_publish: bool = False
