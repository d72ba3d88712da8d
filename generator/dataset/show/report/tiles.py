# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pictures of rows, with the landmarks beside them as numbers."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from generator.dataset.format.dataset_poses import DatasetPoses
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.image import decode_image
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import image_bytes, read_samples
from generator.dataset.format.row_cameras import RowCameras
from generator.dataset.format.schema import sample_id
from generator.dataset.show.fitted import Fitted
from generator.dataset.show.pictures import PAPER, shown_poses
from generator.landmarks.topology import Topology
from generator.plan.poses import ANGLES, PosePlan, pose_name

SHEET_HEADS, SHEET_PX = 6, 160
THUMBNAILS, THUMBNAIL_PX = 120, 112
QUALITY = 78
THOUSAND = 1000
"""Places are told in thousandths of a tile's side."""


def contact_sheet(
    root: Path, manifest: Manifest, heads: Sequence[HeadRow], poses: DatasetPoses, topology: Topology
) -> dict[str, Any] | None:
    """Up to 6 heads at up to 9 poses, or None for a dataset without images.

    poses: of every head; none where each has its own. tiles: a row a head; each {"src", "pose",
    "detected", "found", "exact"} or None where the row is missing.
    Points are whole thousandths of the tile's side, x and y in turn.
    Raises DatasetError: an image or a part is missing or damaged.
    """
    if manifest.images == "none":
        return None
    places = np.unique(np.linspace(0, len(heads) - 1, SHEET_HEADS).round().astype(int)).tolist()
    plans = {place: poses.plan(place) for place in places}
    shown = {place: plan.angles_deg[shown_poses(plan)].tolist() for place, plan in plans.items()}
    rows = read_samples(
        root, manifest, [_name(heads[p], pose) for p, chosen in shown.items() for pose in chosen]
    )
    drawn = _drawn(topology)
    return {
        "poses": shown[places[0]] if poses.plans.shared is not None else [],
        "columns": max(map(len, shown.values())),
        "heads": [{"subject": heads[p].subject, "expression": heads[p].expression} for p in places],
        "tiles": [
            [_tile(root, rows.get(_name(heads[p], pose)), drawn) for pose in chosen]
            for p, chosen in shown.items()
        ],
    }


def thumbnails(
    root: Path, manifest: Manifest, heads: Sequence[HeadRow], poses: DatasetPoses
) -> list[str | None]:
    """A data URI of every head at the pose nearest to the front; None beyond the first 120 or without images.

    Raises DatasetError: an image or a part is missing or damaged.
    """
    if manifest.images == "none":
        return [None] * len(heads)
    names = [_name(head, _most_frontal(poses.plan(k))) for k, head in enumerate(heads[:THUMBNAILS])]
    rows = read_samples(root, manifest, names)
    shown = [picture_uri(root, rows[name], THUMBNAIL_PX) if name in rows else None for name in names]
    return [*shown, *[None] * (len(heads) - len(shown))]


def _most_frontal(plan: PosePlan) -> list[float]:
    return plan.angles_deg[int((plan.angles_deg**2).sum(axis=1).argmin())].tolist()


def _name(head: HeadRow, pose: Sequence[float]) -> str:
    return sample_id(head.subject, head.expression, pose_name(*pose))


def _drawn(topology: Topology) -> np.ndarray:
    """The points that are drawn: the outlines of the parts, without the cheeks between them."""
    parts = [np.array(points) for points in topology.parts.values()]
    return np.unique(np.concatenate(parts)) if parts else np.arange(topology.count)


def _tile(root: Path, row: Mapping[str, Any] | None, drawn: np.ndarray) -> dict[str, Any] | None:
    if row is None:  # a unit that failed leaves an empty place
        return None
    exact_mm = np.array(row["landmarks_exact"], np.float64).reshape(1, -1, 3)
    exact = RowCameras.of_row(row).pixels(exact_mm)[0]
    found = np.array(row["landmarks"]).reshape(-1, 3)
    return {
        "src": picture_uri(root, row, SHEET_PX),
        "pose": [row[f"{angle}_deg"] for angle in ANGLES],
        "detected": row["detected"],
        "found": _points(found[drawn], row),
        "exact": _points(exact[drawn], row),
    }


def _points(points: np.ndarray, row: Mapping[str, Any]) -> list[int]:
    placed = Fitted.of(row["width"], row["height"], THOUSAND).points(points)
    return placed[np.isfinite(placed).all(axis=1)].round().astype(int).ravel().tolist()


def picture_uri(root: Path, row: Mapping[str, Any], size: int) -> str:
    """The image of a row as a data URI: a JPEG with sides of size pixels.

    Raises DatasetError: it is missing or damaged.
    """
    picture = decode_image(image_bytes(root, row), f"{root}: the image of {row['sample_id']}")
    file = io.BytesIO()
    tile = Fitted.of(row["width"], row["height"], size).paste(picture, PAPER)
    tile.save(file, "JPEG", quality=QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(file.getvalue()).decode()
