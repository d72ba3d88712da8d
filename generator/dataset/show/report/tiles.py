# SPDX-License-Identifier: GPL-3.0-or-later
"""Small pictures of rows, with the landmarks beside them as numbers."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image, UnidentifiedImageError

from generator.dataset.export.sample import exact_pixels
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import image_bytes, read_samples
from generator.dataset.format.schema import LANDMARKS, sample_id
from generator.dataset.show.pictures import shown_poses
from generator.dataset.show.report.regions import REGIONS
from generator.errors import DatasetError
from generator.plan.poses import PosePlan, pose_name

SHEET_HEADS, SHEET_PX = 6, 160
THUMBNAILS, THUMBNAIL_PX = 120, 112
QUALITY = 78

# The points that are drawn: the outlines of the parts, without the cheeks between them.
DRAWN = np.unique(np.concatenate([points for name, points in REGIONS.items() if name != "whole face"]))


def contact_sheet(
    root: Path, manifest: Manifest, heads: Sequence[HeadRow], plan: PosePlan
) -> dict[str, Any] | None:
    """Up to 6 heads at up to 9 poses, or None for a dataset without images.

    tiles: a row a head; each {"src", "detected", "found", "exact"} or None where the row is missing.
    Points are whole thousandths of the image's side, x and y in turn.
    Raises DatasetError: an image or a part is missing or damaged.
    """
    if manifest.images == "none":
        return None
    places = np.unique(np.linspace(0, len(heads) - 1, SHEET_HEADS).round().astype(int))
    heads = [heads[i] for i in places]
    poses = plan.angles_deg[shown_poses(plan)].tolist()
    rows = read_samples(root, manifest, [_name(head, pose) for head in heads for pose in poses])
    return {
        "poses": poses,
        "heads": [{"subject": head.subject, "expression": head.expression} for head in heads],
        "tiles": [[_tile(root, rows.get(_name(head, pose))) for pose in poses] for head in heads],
    }


def thumbnails(root: Path, manifest: Manifest, heads: Sequence[HeadRow], plan: PosePlan) -> list[str | None]:
    """A data URI of every head at the pose nearest to the front; None beyond the first 120 or without images.

    Raises DatasetError: an image or a part is missing or damaged.
    """
    if manifest.images == "none":
        return [None] * len(heads)
    pose = plan.angles_deg[int((plan.angles_deg**2).sum(axis=1).argmin())].tolist()
    names = [_name(head, pose) for head in heads[:THUMBNAILS]]
    rows = read_samples(root, manifest, names)
    shown = [_picture(root, rows[name], THUMBNAIL_PX) if name in rows else None for name in names]
    return [*shown, *[None] * (len(heads) - len(shown))]


def _name(head: HeadRow, pose: Sequence[float]) -> str:
    return sample_id(head.subject, head.expression, pose_name(*pose))


def _tile(root: Path, row: Mapping[str, Any] | None) -> dict[str, Any] | None:
    if row is None:  # a unit that failed leaves an empty place
        return None
    exact_mm = np.array(row["landmarks_exact"], np.float64).reshape(1, LANDMARKS, 3)
    camera = np.array(row["camera"]).reshape(1, 3, 3)
    exact = exact_pixels(exact_mm, camera, np.array(row["translation_mm"])[None], row["projection"])[0]
    found = np.array(row["landmarks"]).reshape(LANDMARKS, 3)
    return {
        "src": _picture(root, row, SHEET_PX),
        "detected": row["detected"],
        "found": _points(found, row["width"]),
        "exact": _points(exact, row["width"]),
    }


def _points(points: np.ndarray, width: int) -> list[int]:
    drawn = points[DRAWN, :2] * 1000 / width
    return drawn[np.isfinite(drawn).all(axis=1)].round().astype(int).ravel().tolist()


def _picture(root: Path, row: Mapping[str, Any], size: int) -> str:
    try:
        picture = Image.open(io.BytesIO(image_bytes(root, row))).convert("RGB")
    except (UnidentifiedImageError, OSError) as error:
        raise DatasetError(
            f"{root}: the image of {row['sample_id']} cannot be decoded; see `headturn verify`"
        ) from error
    file = io.BytesIO()
    picture.resize((size, size), Image.Resampling.LANCZOS).save(file, "JPEG", quality=QUALITY)
    return "data:image/jpeg;base64," + base64.b64encode(file.getvalue()).decode()
