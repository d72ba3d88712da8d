# SPDX-License-Identifier: GPL-3.0-or-later
"""What the fixture ``placed_head`` gives."""

from __future__ import annotations

from dataclasses import dataclass

from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.placement import Placement


@dataclass(frozen=True)
class PlacedHead:
    """A head with its face found: mesh in frame U, mm, pivot at the origin."""

    head: Head
    placement: Placement
    mesh: HeadMesh
