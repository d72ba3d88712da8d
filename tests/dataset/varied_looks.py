# SPDX-License-Identifier: GPL-3.0-or-later
"""A dataset whose looks are drawn, for what tells of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import small_dataset
from small_dataset import CAMERA

from generator.dataset.format.manifest import read_manifest, write_manifest
from generator.plan.config import load_config
from generator.plan.view_plan import drawn_render

DRAWN = {
    "ambient": "head:uniform:0.2,0.6",
    "exposure_ev": "normal:0,0.4",
    "noise": "log-uniform:0.001,0.1",
    "jpeg": "choice:50,50,80,90",
    "backdrop": "choice:plain,noise",
    "background": ["uniform:0,1", 0.25, 0.5],
}


def build_varied(root: Path) -> Path:
    """2 heads x 18 poses."""
    config = load_config(None, {"render": DRAWN})
    original = small_dataset.unit_rows

    def drawn(head: Any, plan: Any, chosen: slice, camera: Any = CAMERA) -> Any:
        rows = original(head, plan, chosen, camera)
        name, poses = f"{head.subject}/{head.expression}", map(tuple, rows.angles_deg.tolist())
        return replace(rows, looks=tuple(drawn_render(config, name, pose).look for pose in poses))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(small_dataset, "unit_rows", drawn)
        manifest = small_dataset.build_dataset(root)
    configuration = {**manifest.configuration, "render": config.as_dict()["render"]}
    write_manifest(replace(read_manifest(root), configuration=configuration), root)
    return root
