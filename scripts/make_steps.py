# SPDX-License-Identifier: GPL-3.0-or-later
"""The picture of docs/concepts.md: one pose from a head's file to its row. make_pictures.py calls it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from PIL import Image, ImageDraw, ImageFont

from generator.dataset.show.pictures import DOT, INK, MISS, PAPER

SIDE, GAP, TEXT, COLUMNS = 340, 14, 70, 3


def story(dataset: Path) -> Image.Image:
    """Six panels, each with what it shows. dataset: one head, with passes depth and normal."""
    rows = pq.read_table(dataset / "data", partitioning=None).to_pylist()
    level = min(rows, key=turned)
    row = max(rows, key=turned)
    angles = ", ".join(f"{row[name]:+.0f}°" for name in ("yaw_deg", "pitch_deg", "roll_deg"))
    panels = [
        (mesh(dataset), "1  a head's file", "triangles, in its own axes"),
        (marked(dataset, level, "exact"), "2  placed", "its anchors at pose zero"),
        (marked(dataset, row, ""), "3  turned and rendered", f"yaw, pitch, roll {angles}"),
        (marked(dataset, row, "found"), "4  landmarks", "what the detector found"),
        (marked(dataset, row, "exact"), "5  exact landmarks", "green: seen, red: hidden"),
        (passes(dataset, row), "6  passes", "depth, and where surfaces face"),
    ]
    lines = -(-len(panels) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * (SIDE + GAP) - GAP, lines * (SIDE + TEXT)), PAPER)
    draw = ImageDraw.Draw(sheet)
    for k, (panel, title, told) in enumerate(panels):
        left, top = k % COLUMNS * (SIDE + GAP), k // COLUMNS * (SIDE + TEXT)
        sheet.paste(panel, (left, top))
        draw.text((left + 4, top + SIDE + 6), title, INK, ImageFont.load_default(22))
        draw.text((left + 4, top + SIDE + 33), told, "#666666", ImageFont.load_default(19))
    return sheet


def turned(row: dict[str, Any]) -> float:
    """By how much a row's head is turned, degrees, summed over the angles."""
    return sum(abs(row[name]) for name in ("yaw_deg", "pitch_deg", "roll_deg"))


def mesh(dataset: Path) -> Image.Image:
    """The triangles of the file, seen along its own axes."""
    [file] = (dataset / "heads").rglob("*.obj")
    words = [line.split() for line in file.read_text(encoding="utf-8").splitlines()]
    points = np.array([word[1:4] for word in words if word[:1] == ["v"]], dtype=float)
    faces = [[int(part.split("/")[0]) - 1 for part in word[1:]] for word in words if word[:1] == ["f"]]
    used = points[sorted({corner for face in faces for corner in face})]
    low, high = used.min(axis=0), used.max(axis=0)
    scale = 0.92 * 2 * SIDE / max(high[:2] - low[:2])
    middle = (low + high) / 2
    picture = Image.new("RGB", (2 * SIDE, 2 * SIDE), "white")
    draw = ImageDraw.Draw(picture)
    for face in sorted(faces, key=lambda face: points[face, 2].mean()):
        corners = points[face]
        across, up = corners[1] - corners[0], corners[2] - corners[0]
        facing = np.cross(across, up)
        if facing[2] <= 0:
            continue
        at = (corners[:, :2] - middle[:2]) * [scale, -scale] + SIDE
        tone = int(150 + 100 * facing[2] / np.linalg.norm(facing))
        draw.polygon([tuple(point) for point in at], fill=(tone, tone, tone), outline="#5b6f7a")
    return picture.resize((SIDE, SIDE), Image.Resampling.LANCZOS)


def marked(dataset: Path, row: dict[str, Any], which: str) -> Image.Image:
    """The row's image with landmarks: exact ones, those found, or none."""
    picture = Image.open(dataset / row["image_path"]).convert("RGB")
    picture = picture.resize((2 * SIDE, 2 * SIDE), Image.Resampling.LANCZOS)
    draw = ImageDraw.Draw(picture)
    points, colours = np.empty((0, 2)), []
    if which == "exact":
        exact = np.reshape(row["landmarks_exact"], (-1, 3))
        seen = np.array(row["landmarks_visible"])
        projected = exact @ np.reshape(row["camera"], (3, 3)).T
        points, colours = projected[:, :2] / projected[:, 2:], np.where(seen, DOT, MISS).tolist()
    elif which == "found":
        points = np.reshape(row["landmarks"], (-1, 3))[:, :2]
        colours = ["#ffb000"] * len(points)
    for (x, y), colour in zip(points * 2 * SIDE / row["width"], colours, strict=True):
        draw.ellipse((x - 2.6, y - 2.6, x + 2.6, y + 2.6), fill=colour)
    return picture.resize((SIDE, SIDE), Image.Resampling.LANCZOS)


def passes(dataset: Path, row: dict[str, Any]) -> Image.Image:
    """Depth on the left half, where the surface faces on the right one."""
    import OpenEXR

    with OpenEXR.File(str(dataset / row["passes_path"]), separate_channels=True) as file:
        channels = file.channels()
        depth = channels["depth.Z"].pixels
        normal = np.stack([channels[f"normal.{axis}"].pixels for axis in "XYZ"], axis=-1)
    nearest, farthest = np.nanmin(depth), np.nanmax(depth)
    near = 255 - 190 * (depth - nearest) / (farthest - nearest)
    shown = np.repeat(near[..., None], 3, axis=-1)
    half = depth.shape[1] // 2
    shown[:, half:] = (normal * [1, -1, -1] * 127 + 128)[:, half:]
    pixels = np.where(np.isnan(shown), 40, shown).astype(np.uint8)
    return Image.fromarray(pixels).resize((SIDE, SIDE), Image.Resampling.LANCZOS)
