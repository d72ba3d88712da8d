# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import io
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image, ImageColor

from generator.dataset.format.manifest import read_manifest
from generator.dataset.format.open import image_bytes, read_rows, read_samples
from generator.dataset.show.detection import tally_detection
from generator.dataset.show.pictures import (
    ANCHOR_TILE,
    DOT,
    GAP,
    LEFT,
    MISS,
    TILE,
    TOP,
    anchor_sheet,
    contact_sheet,
    detection_map,
    shown_poses,
)
from generator.errors import DatasetError
from generator.plan.poses import sobol_plan, uniform_plan


def tile(sheet: np.ndarray, row: int, column: int) -> np.ndarray:
    y, x = TOP + row * (TILE + GAP), LEFT + column * (TILE + GAP)
    return sheet[y : y + TILE, x : x + TILE]


def count(pixels: np.ndarray, color: str) -> int:
    return int((pixels == ImageColor.getrgb(color)).all(axis=-1).sum())


@pytest.mark.parametrize("images", ["files", "embedded"])
def test_contact_sheet(build, tmp_path, images):
    manifest = build(tmp_path / "d", images)
    out = contact_sheet(tmp_path / "d", manifest, tmp_path / "sheet.png")
    with Image.open(out) as picture:
        sheet = np.asarray(picture)
    columns = (sheet.shape[1] - LEFT) // (TILE + GAP)
    assert (sheet.shape[0] - TOP) // (TILE + GAP) == 2 and 6 <= columns <= 9
    frontal, corner = tile(sheet, 0, 0), tile(sheet, 1, columns - 1)
    assert count(frontal, DOT) > 200 and count(frontal, MISS) == 0
    assert count(corner, MISS) > 2000 and count(corner, DOT) == 0
    again = contact_sheet(tmp_path / "d", manifest, tmp_path / "again.png")
    assert again.read_bytes() == out.read_bytes()


def test_every_head_shows_as_many_poses_as_it_may():
    """Random poses lie where they fall: one of them is often the nearest to several places of a sheet."""
    for seed in range(20):
        plan = sobol_plan(20, seed)
        assert len(set(shown_poses(plan))) == len(shown_poses(plan)) == 9
        assert sorted(shown_poses(sobol_plan(3, seed))) == [0, 1, 2]


def test_anchor_sheet_shows_what_is_seen_and_what_is_hidden(build, tmp_path):
    manifest = build(tmp_path / "d")
    with Image.open(anchor_sheet(tmp_path / "d", manifest, tmp_path / "sheet.png")) as picture:
        sheet = np.asarray(picture)
    step = ANCHOR_TILE + GAP
    front = sheet[TOP : TOP + ANCHOR_TILE, LEFT : LEFT + ANCHOR_TILE]
    turned = sheet[TOP : TOP + ANCHOR_TILE, LEFT + step : LEFT + step + ANCHOR_TILE]
    assert count(front, DOT) > 300 and count(turned, DOT) > 200
    assert count(turned, MISS) > count(front, MISS)


def test_landmarks_lie_on_the_face(dataset):
    """Dots are drawn where the image shows the face: no flip, no half-pixel scale error."""
    manifest = read_manifest(dataset)
    name = "s1/neutral/y-30_p-20_r+0"
    row = read_samples(dataset, manifest, [name])[name]
    pixels = np.asarray(Image.open(io.BytesIO(image_bytes(dataset, row))))
    x, y = np.array(row["landmarks"]).reshape(468, 3)[:, :2].astype(int).T
    assert (pixels[y, x] != 128).any(axis=-1).all()


def test_contact_sheet_without_images(build, tmp_path):
    manifest = build(tmp_path / "d", "none")
    with pytest.raises(DatasetError, match="built with images = none, so there is nothing to show"):
        contact_sheet(tmp_path / "d", manifest, tmp_path / "sheet.png")


def test_contact_sheet_of_a_build_with_failed_units(build, tmp_path):
    manifest = build(tmp_path / "d")
    manifest = replace(manifest, parts=manifest.parts[:-1])
    with Image.open(contact_sheet(tmp_path / "d", manifest, tmp_path / "s.png")) as picture:
        sheet = np.asarray(picture)
    columns = (sheet.shape[1] - LEFT) // (TILE + GAP)
    assert np.ptp(tile(sheet, 1, columns - 1)) == 0


@pytest.mark.parametrize("damage", ["missing", "no image"])
def test_contact_sheet_names_a_broken_image(dataset, damage):
    for path in (dataset / "images").rglob("*.png"):
        path.write_bytes(b"no image") if damage == "no image" else path.unlink()
    with pytest.raises(DatasetError, match="cannot be"):
        contact_sheet(dataset, read_manifest(dataset), dataset / "sheet.png")


def test_tally_counts_cells(dataset):
    tally = tally_detection(dataset, read_manifest(dataset))
    cells = {(cell.yaw_deg, cell.pitch_deg): cell for cell in tally.by_cell()}
    assert len(cells) == 9 and {cell.rows for cell in cells.values()} == {4}
    assert cells[30, 20].rate == 0 and sum(cell.rate for cell in cells.values()) == 8
    assert tally.rate == pytest.approx(32 / 36)


@pytest.mark.parametrize("plan", [None, uniform_plan(30, 2)], ids=["grid", "uniform"])
def test_detection_map(build, tmp_path, plan):
    manifest = build(tmp_path / "d", "none", **({"plan": plan} if plan else {}))
    out = detection_map(tmp_path / "d", manifest, tmp_path / "map.png")
    with Image.open(out) as picture:
        assert min(picture.size) > 200 and len(picture.convert("RGB").getcolors(2**20)) > 50
    assert detection_map(tmp_path / "d", manifest, tmp_path / "b.png").read_bytes() == out.read_bytes()


def test_a_missing_part_is_named(dataset):
    manifest = read_manifest(dataset)
    (dataset / manifest.parts[0].path).unlink()
    with pytest.raises(DatasetError, match=r"part-s1-0.*`headturn verify` says what is wrong"):
        detection_map(dataset, manifest, dataset / "map.png")
    assert list(read_rows(dataset, manifest.parts[1:2], ["detected"]))
