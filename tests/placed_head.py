# SPDX-License-Identifier: GPL-3.0-or-later
"""What the fixture ``placed_head`` gives."""

from __future__ import annotations

from dataclasses import dataclass

from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.placing.face import Prepared


@dataclass(frozen=True)
class PlacedHead:
    """A head with its face found: mesh in frame U, mm, pivot at the origin."""

    head: Head
    prepared: Prepared
    mesh: HeadMesh
