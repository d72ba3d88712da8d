# SPDX-License-Identifier: GPL-3.0-or-later
"""What a planned head becomes in heads.parquet and anchors.parquet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from generator.dataset.format.anchors_table import HeadAnchors
from generator.dataset.format.heads_table import HEADS_FILE, HeadRow, read_heads
from generator.errors import DatasetError
from generator.execution.build.units import PlannedHead
from generator.landmarks.topology import Topology
from generator.platforms import relative_path


def head_row(planned: PlannedHead, mesh_path: str, topology: Topology) -> HeadRow:
    """The row of heads.parquet. mesh_path: relative to the root of its source."""
    head, placement, anchors = planned.head, planned.placement, planned.anchors
    return HeadRow(
        subject=head.subject,
        expression=head.expression,
        source=head.source,
        mesh_path=mesh_path,
        file_sha256=planned.file_sha256,
        license=head.license,
        redistributable=head.redistributable,
        attribution=head.attribution,
        units=placement.units,
        mm_per_unit=placement.mm_per_unit,
        up=placement.up,
        forward=placement.forward,
        pivot=placement.pivot,
        radius_mm=placement.radius_mm,
        distance_mm=planned.camera.distance_mm,
        lens_mm=planned.camera.lens_mm,
        projection=planned.camera.projection,
        frame=placement.frame,
        correction=placement.correction,
        correction_sd_deg=placement.correction_sd_deg,
        anchor_way=anchors.way,
        anchor_views=anchors.views,
        anchor_off=anchors.off,
        anchor_absent=anchors.absent,
        anchor_residual_px=anchors.residual_px,
        anchor_residual_mm=anchors.residual_mm,
        anchor_asymmetry_mm=round(anchors.asymmetry_mm(topology), 6),
        scene_camera=placement.scene_camera.numbers if placement.scene_camera else (),
        vertices=planned.vertices,
        triangles=planned.triangles,
        split=planned.split,
        problems=tuple(dict.fromkeys((*head.problems, *planned.problems, *placement.notes))),
    )


def head_anchors(planned: PlannedHead) -> HeadAnchors:
    """The row of anchors.parquet: points at the pose zero of the dataset."""
    return HeadAnchors(
        subject=planned.head.subject,
        expression=planned.head.expression,
        triangles=planned.anchors.triangles,
        weights=planned.anchors.weights,
        points=planned.points,
    )


def changed_files(planned: Sequence[PlannedHead], root: Path) -> list[str]:
    """Files of heads that are not as heads.parquet says, as it names them; none before a build has ended."""
    if not (root / HEADS_FILE).exists():
        return []
    try:
        recorded = dict(file for row in read_heads(root) for file in row.file_sha256)
    except DatasetError:  # it is written anew, and decides nothing until then
        return []
    now = dict(file for head in planned for file in head.file_sha256)
    return [name for name, sha256 in now.items() if recorded.get(name, sha256) != sha256]


def relative(path: Path, root: Path) -> str:
    """path relative to the root of its source, with "/"."""
    return relative_path(path, root if root.is_dir() else root.parent)
