# SPDX-License-Identifier: GPL-3.0-or-later
"""A dataset whose detector is off by a known error, for the report's tests."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import small_dataset
from small_dataset import CAMERA, HEADS

from generator.landmarks.topology import FACE_MESH
from generator.plan.poses import grid_plan

PLAN = grid_plan((-30, 30, 15), (-20, 20, 20), (-10, 10, 10))
REGIONS = FACE_MESH.regions
SHIFT = {"eyes": (2.0, -1.0), "mouth": (0.0, 3.0)}
"""Known errors, pixels right and down, added to what the detector says of s1; s2 gets twice as much."""


def build_known(root: Path) -> Path:
    """Off by SHIFT, and otherwise exact."""
    original = small_dataset.unit_rows

    def shifted(head, plan, chosen, camera=CAMERA):
        rows = original(head, plan, chosen, camera)
        landmarks = rows.landmarks.copy()
        for name, (dx, dy) in SHIFT.items():
            landmarks[:, REGIONS[name], :2] += np.array([dx, dy]) * (1 if head.subject == "s1" else 2)
        # One more miss, so that yaw and pitch cannot be taken for each other.
        missed = (rows.angles_deg == (-15, 0, 10)).all(axis=1)
        landmarks[missed] = np.nan
        return replace(rows, landmarks=landmarks, detected=rows.detected & ~missed)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(small_dataset, "unit_rows", shifted)
        hidden = replace(HEADS[1], redistributable=False, license="</script><b>FaceScape & co")
        small_dataset.build_dataset(root, heads=(HEADS[0], hidden), plan=PLAN)
    return root
