# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that show a dataset at a glance: contact sheets and a map of the detector."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from generator.dataset.format.dataset_poses import DatasetPoses, read_dataset_poses
from generator.dataset.format.files import write_bytes
from generator.dataset.format.heads_table import HeadRow, read_heads
from generator.dataset.format.image import decode_image
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import image_bytes, read_samples
from generator.dataset.format.row_cameras import RowCameras
from generator.dataset.format.schema import sample_id
from generator.dataset.show.detection import MAX_CELLS, tally_detection
from generator.dataset.show.fitted import Fitted
from generator.errors import DatasetError
from generator.plan.poses import ANGLES, PosePlan

SHEET_HEADS = 6
TILE, ANCHOR_TILE, GAP, TOP, LEFT = 168, 224, 8, 40, 132
PAPER, INK, FAINT, DOT, MISS = "#fafafa", "#222222", "#777777", "#19e3b1", "#d7263d"

# Where the shown poses lie in the range of (yaw, pitch, roll): -1, 0, 1 are its ends and its middle.
SHEET_POSES = (
    (0, 0, 0), (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1), (-1, -1, -1), (1, 1, 1),
)  # fmt: skip


def contact_sheet(dataset: Path, manifest: Manifest, out: Path) -> Path:
    """Write a PNG of up to 6 heads (rows) at up to 9 poses (columns) with their landmarks.

    Heads, poses.csv and the parts must be there; the manifest may not be written yet. Returns out.
    Raises DatasetError: the dataset has no images, or lacks a file.
    """
    legend = [("landmarks found", DOT)]
    return _sheet(dataset, manifest, out, TILE, _mark_detected, lambda head: head.expression, legend)


def anchor_sheet(dataset: Path, manifest: Manifest, out: Path) -> Path:
    """As :func:`contact_sheet`, with the exact landmarks: seen ones green, hidden ones red.

    Beside each head: rms distance of the detections from its anchors, and points without one.
    """

    def quality(head: HeadRow) -> str:
        lost = f", {head.anchor_absent} absent" if head.anchor_absent else ""
        return f"rms {head.anchor_residual_px:.1f} px{lost}" if head.anchor_views else "no anchors"

    legend = [("exact, seen", DOT), ("exact, hidden", MISS)]
    return _sheet(dataset, manifest, out, ANCHOR_TILE, _mark_exact, quality, legend)


def _sheet(
    dataset: Path,
    manifest: Manifest,
    out: Path,
    side: int,
    mark: Callable[[ImageDraw.ImageDraw, dict, Fitted], None],
    caption: Callable[[HeadRow], str],
    legend: list[tuple[str, str]],
) -> Path:
    """mark(draw, row, fitted) draws onto a tile; caption stands below the subject.

    legend: what a colour means, in the corner.
    """
    if manifest.images == "none":
        raise DatasetError(
            f"{dataset}: built with images = none, so there is nothing to show; build with files or embedded"
        )
    heads = read_heads(dataset)
    poses = read_dataset_poses(dataset, heads)
    places = np.unique(np.linspace(0, len(heads) - 1, SHEET_HEADS).round().astype(int)).tolist()
    shown = {place: shown_poses(poses.plan(place)) for place in places}
    columns = max(map(len, shown.values()))
    names = [_row_name(heads[p], poses, p, k) for p, chosen in shown.items() for k in chosen]
    rows = read_samples(dataset, manifest, names)
    own = poses.plans.shared is None

    size = (LEFT + columns * (side + GAP), TOP + len(places) * (side + GAP))
    sheet = Image.new("RGB", size, PAPER)
    draw = ImageDraw.Draw(sheet)
    font, small = ImageFont.load_default(14), ImageFont.load_default(12)
    if own:
        told = "every head has its own poses: yaw, pitch and roll are on each image"
        draw.text((LEFT, 20), told, FAINT, font, anchor="lm")
    titles = [] if own else poses.plan(places[0]).angles_deg[shown[places[0]]].tolist()
    for column, pose in enumerate(titles):
        for place, (name, angle) in enumerate(zip(ANGLES, pose, strict=True)):
            x = LEFT + column * (side + GAP) + side * (2 * place + 1) / 6
            draw.text((x, 12), name, FAINT, small, anchor="mm")
            draw.text((x, 28), f"{angle:.1f}".removesuffix(".0") + "°", INK, font, anchor="mm")
    for line, (what, color) in enumerate(legend):
        y = 8 + 12 * line
        draw.rectangle((GAP, y - 3, GAP + 6, y + 3), fill=color)
        draw.text((GAP + 11, y), what, FAINT, ImageFont.load_default(11), anchor="lm")
    for line, (place, chosen) in enumerate(shown.items()):
        head = heads[place]
        top = TOP + line * (side + GAP)
        draw.text((GAP, top + side / 2 - 10), _fit(draw, head.subject, font), INK, font, anchor="lm")
        draw.text((GAP, top + side / 2 + 10), _fit(draw, caption(head), small), FAINT, small, anchor="lm")
        for column, pose in enumerate(chosen):
            row = rows.get(_row_name(head, poses, place, pose))
            if row is not None:  # a unit that failed leaves an empty place
                fitted = Fitted.of(row["width"], row["height"], side)
                tile = fitted.paste(_picture(dataset, row), PAPER)
                on_tile = ImageDraw.Draw(tile)
                mark(on_tile, row, fitted)
                if own:
                    angles = poses.plan(place).angles_deg[pose].tolist()
                    said = " ".join(f"{angle:+.0f}" for angle in angles)
                    on_tile.text((4, 3), said, INK, small, stroke_width=2, stroke_fill=PAPER)
                sheet.paste(tile, (LEFT + column * (side + GAP), top))
    png = io.BytesIO()
    sheet.save(png, "PNG")
    write_bytes(out, png.getvalue())
    return out


def detection_map(dataset: Path, manifest: Manifest, out: Path) -> Path:
    """Write a PNG of the detection rate over yaw x pitch, the mean over rolls and heads.

    Poses off the grid are counted in cells of 10°. Returns out.
    Raises DatasetError: the dataset lacks a file or has no rows.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    tally = tally_detection(dataset, manifest)
    cells = tally.by_cell()
    if not cells:
        raise DatasetError(f"{dataset}: no rows to count; run `headturn build` again")
    yaws, pitches = _even(cell.yaw_deg for cell in cells), _even(cell.pitch_deg for cell in cells)
    rates = np.full((len(pitches), len(yaws)), np.nan)
    for cell in cells:
        rates[pitches.index(cell.pitch_deg), yaws.index(cell.yaw_deg)] = 100 * cell.rate

    size = (2.6 + 0.55 * len(yaws), 1.8 + 0.45 * len(pitches))
    figure = Figure(figsize=size, dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    image = axes.imshow(rates, origin="lower", vmin=0, vmax=100, cmap="viridis", aspect="auto")
    for y, x in np.argwhere(np.isfinite(rates)).tolist():
        color = "black" if rates[y, x] > 60 else "white"
        axes.text(x, y, f"{rates[y, x]:.0f}", ha="center", va="center", color=color, fontsize=8)
    axes.set_xticks(range(len(yaws)), [f"{yaw:g}" for yaw in yaws])
    axes.set_yticks(range(len(pitches)), [f"{pitch:g}" for pitch in pitches])
    axes.set_xlabel("yaw, degrees (+ = nose to image left)")
    axes.set_ylabel("pitch, degrees (+ = nose up)")
    axes.set_title(f"Faces found: {tally.rate:.1%} of {manifest.rows:,} images", fontsize=11)
    figure.colorbar(image, label="faces found, %")
    png = io.BytesIO()
    figure.savefig(png, format="png", metadata={"Software": None})
    write_bytes(out, png.getvalue())
    return out


def _even(values: Iterable[float]) -> list[float]:
    """Distinct values in order, with those between that nothing fell on, so that a map keeps its scale."""
    found = sorted(set(values))
    if len(found) < 3:
        return found
    step = min(b - a for a, b in pairwise(found))
    places = [(value - found[0]) / step for value in found]
    if places[-1] > MAX_CELLS or any(abs(place - round(place)) > 1e-6 for place in places):
        return found
    known = {round(place): value for place, value in zip(places, found, strict=True)}
    return [known.get(k, found[0] + k * step) for k in range(round(places[-1]) + 1)]


def _row_name(head: HeadRow, poses: DatasetPoses, place: int, pose: int) -> str:
    return sample_id(head.subject, head.expression, poses.name(place, pose))


def shown_poses(plan: PosePlan) -> list[int]:
    """The poses of the plan nearest to the middle and the ends of its range: nine, or all of fewer."""
    low, high = plan.angles_deg.min(axis=0), plan.angles_deg.max(axis=0)
    middle, half = (low + high) / 2, np.maximum((high - low) / 2, 1e-9)
    place = (plan.angles_deg - middle) / half
    chosen: list[int] = []
    for wanted in SHEET_POSES[: len(place)]:
        distance = ((place - wanted) ** 2).sum(axis=1)
        distance[chosen] = np.inf
        chosen.append(int(distance.argmin()))
    return chosen


def _picture(dataset: Path, row: dict) -> Image.Image:
    return decode_image(image_bytes(dataset, row), f"{dataset}: the image of {row['sample_id']}")


def _mark_detected(draw: ImageDraw.ImageDraw, row: dict, fitted: Fitted) -> None:
    side = fitted.side
    if row["detected"]:
        _dots(draw, fitted.points(np.array(row["landmarks"]).reshape(-1, 3)), DOT)
    else:
        draw.rectangle((0, 0, side - 1, side - 1), outline=MISS, width=3)
        draw.rectangle((0, side - 22, side, side), fill=MISS)
        draw.text((side / 2, side - 11), "not detected", "white", ImageFont.load_default(13), anchor="mm")


def _mark_exact(draw: ImageDraw.ImageDraw, row: dict, fitted: Fitted) -> None:
    points = np.array(row["landmarks_exact"]).reshape(-1, 3)
    anchored = np.isfinite(points).all(axis=1)
    visible = np.array(row["landmarks_visible"])[anchored]
    pixels = fitted.points(RowCameras.of_row(row).pixels(points[None, anchored])[0])
    for seen, color in ((False, MISS), (True, DOT)):
        _dots(draw, pixels[visible == seen], color)


def _dots(draw: ImageDraw.ImageDraw, points: np.ndarray, color: str) -> None:
    draw.point([tuple(point) for point in points.tolist()], color)


def _fit(draw: ImageDraw.ImageDraw, text: str, font: ImageFont.FreeTypeFont | ImageFont.ImageFont) -> str:
    """The text, shortened in the middle to the width of the left margin."""
    keep = len(text)
    shown = text
    while draw.textlength(shown, font) > LEFT - 2 * GAP:
        keep -= 1
        shown = text[: keep // 2] + "…" + text[len(text) - (keep - keep // 2) :]
    return shown
