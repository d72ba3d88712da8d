# SPDX-License-Identifier: GPL-3.0-or-later
"""Each row may have a camera of its own, and an image that is not square."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import small_dataset
from damage import failures
from PIL import Image
from small_dataset import HEADS, SMALL_PLAN, draw_face, face_anchors, face_points, face_visible

from generator.dataset.export.run import export_dataset
from generator.dataset.format.digest import content_digest
from generator.dataset.format.heads_table import read_heads
from generator.dataset.format.manifest import read_manifest, write_manifest
from generator.dataset.format.missing import exact_in_pixels
from generator.dataset.format.open import as_array
from generator.dataset.format.part import check_part, read_part
from generator.dataset.format.row_cameras import RowCameras
from generator.dataset.format.schema import part_schema
from generator.dataset.format.unit_rows import UnitRows, unit_table
from generator.dataset.proof import part_checks
from generator.dataset.proof.context import planned_views
from generator.dataset.proof.pass_checks import disagreement, projection_error_px
from generator.dataset.proof.verify import verify_dataset
from generator.dataset.show.fitted import Fitted
from generator.dataset.show.pictures import DOT, LEFT, TILE, TOP, contact_sheet
from generator.dataset.show.report.page import report_data
from generator.errors import DatasetError
from generator.geometry.camera import Camera, isotropic_pixels
from generator.geometry.rotation import rotation_from_angles
from generator.plan.settings import Look
from generator.plan.views import View

CAMERAS = tuple(
    Camera.square(64, 40.0 + 5 * k, 500.0 + 20 * k, "orthographic" if k % 3 == 0 else "perspective")
    for k in range(len(SMALL_PLAN))
)
"""One for each pose of the plan."""


def many_cameras(head, plan, chosen: slice, camera: Camera | None = None) -> UnitRows:
    """As small_dataset's, each pose through its own camera; the detector is without error."""
    cameras = CAMERAS[chosen]
    rows = small_dataset_rows(head, plan, chosen)
    rotations = rotation_from_angles(rows.angles_deg)
    landmarks = np.full_like(rows.landmarks, np.nan)
    visible = np.zeros_like(rows.visible)
    for k, (one, rotation) in enumerate(zip(cameras, rotations, strict=True)):
        points = face_points() @ rotation.T + one.translation_mm
        depth = (points[:, 2:] - one.distance_mm) * one.focal_px / one.distance_mm
        if rows.detected[k]:
            landmarks[k] = np.concatenate([one.project(points), depth], axis=1)
        pixels = one.project(face_anchors() @ rotation.T + one.translation_mm)
        inside = ((pixels >= 0) & (pixels <= 64)).all(axis=1)
        visible[k] = face_visible(rotation[None], one)[0] & inside
    images = [draw_face(r, one, (224, 190, 160)) for r, one in zip(rotations, cameras, strict=True)]
    return replace(rows, cameras=cameras, landmarks=landmarks, visible=visible, images=images)


small_dataset_rows = small_dataset.unit_rows


@pytest.fixture
def dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setattr(small_dataset, "unit_rows", many_cameras)
    small_dataset.build_dataset(tmp_path / "d")
    monkeypatch.setattr(
        part_checks,
        "planned_views",
        lambda *_: lambda head, pose: View((0.0, 0.0, 0.0), CAMERAS[pose], Look()),
    )
    return tmp_path / "d"


def test_every_row_has_its_camera(dataset: Path) -> None:
    table = read_part(dataset / "data/train/part-s1-0.parquet")
    for k, camera in enumerate(CAMERAS[:10]):
        np.testing.assert_array_equal(as_array(table, "camera")[k].reshape(3, 3), camera.matrix)
        np.testing.assert_array_equal(as_array(table, "translation_mm")[k], camera.translation_mm)
        assert table["projection"][k].as_py() == camera.projection
    rotation = rotation_from_angles(SMALL_PLAN.angles_deg)
    expected = face_anchors() @ rotation[7].T + CAMERAS[7].translation_mm
    np.testing.assert_array_equal(as_array(table, "landmarks_exact")[7], expected.astype(np.float32))
    cameras = RowCameras.of(table)
    assert len(cameras) == 10 and len(cameras[np.arange(10) % 2 == 0]) == 5
    seen = cameras.pixels(as_array(table, "landmarks_exact"))
    for k, camera in enumerate(CAMERAS[:10]):
        exact = as_array(table, "landmarks_exact")[k]
        np.testing.assert_allclose(seen[k, :, :2], camera.project(exact), atol=1e-9)
        alone = RowCameras.of_row(table.slice(k, 1).to_pylist()[0]).pixels(exact[None])
        np.testing.assert_array_equal(alone[0], seen[k])


def test_many_cameras_are_verified_row_by_row(dataset: Path) -> None:
    report = verify_dataset(dataset, workers=1)
    assert report.ok, report.text()
    part = dataset / "data/train/part-s1-0.parquet"
    table = read_part(part)
    place = table.schema.get_field_index("camera")
    swapped = table["camera"].combine_chunks().take(pa.array([1, 0, *range(2, 10)]))
    pq.write_table(table.set_column(place, table.schema.field(place), swapped), part)
    manifest = read_manifest(dataset)
    parts = tuple(check_part(dataset / p.path) if p.path in str(part) else p for p in manifest.parts)
    write_manifest(replace(manifest, parts=parts), dataset)
    problems = failures(verify_dataset(dataset, workers=1))
    assert set(problems) <= {"camera", "exact landmarks"}
    assert problems["camera"].count("camera is not what the configuration plans") == 2


def test_a_camera_that_is_not_the_heads_is_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(small_dataset, "unit_rows", many_cameras)
    small_dataset.build_dataset(tmp_path / "d")
    assert (
        "camera is not what the configuration plans"
        in failures(verify_dataset(tmp_path / "d", workers=1))["camera"]
    )


def test_the_report_and_exports_take_the_rows_camera(dataset: Path, tmp_path: Path) -> None:
    [data] = report_data(dataset, lambda _: None)["detectors"]
    assert data["overall"]["compared"] == 32
    assert data["overall"]["distance_px"] < 1e-3, "an ideal detector, whatever the camera"
    assert data["overall"]["geodesic_deg"] < 1e-3
    sio = pytest.importorskip("scipy.io")
    export_dataset(dataset, "300w-lp", tmp_path / "out")
    rows = {row["sample_id"]: row for row in pq.read_table(dataset / "data").to_pylist()}
    for k, name in enumerate(["s1/neutral/y-30_p-20_r+0", "s1/neutral/y-30_p-20_r+10"]):
        mat = sio.loadmat(tmp_path / "out" / "train" / f"{name.replace('/', '_')}.mat")
        np.testing.assert_array_equal(mat["Camera"], CAMERAS[k].matrix)
        np.testing.assert_array_equal(mat["Camera"].ravel(), rows[name]["camera"])


def test_missing_landmarks_are_filled_with_the_rows_camera() -> None:
    rows = many_cameras(HEADS[0], SMALL_PLAN, slice(None))
    ideal = exact_in_pixels(unit_table(rows, part_schema("none", {}, "")))
    found = rows.detected
    np.testing.assert_allclose(ideal[found][:, :-1], rows.landmarks[found][:, :-1], atol=2e-3)


def test_as_many_cameras_as_rows_or_one(rows: UnitRows) -> None:
    with pytest.raises(ValueError, match="cameras: expected 1 or 18, got 2"):
        replace(rows, cameras=CAMERAS[:2])
    same = replace(rows, cameras=rows.cameras * 18)
    schema = part_schema("none", {}, "")
    assert content_digest(unit_table(same, schema)) == content_digest(unit_table(rows, schema))


def test_isotropic_pixels_are_those_of_the_cameras() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-80, 80, (18, 30, 3)) + np.array([0, 0, 600.0])
    found = isotropic_pixels(
        points,
        np.stack([camera.matrix for camera in CAMERAS]),
        np.stack([camera.translation_mm for camera in CAMERAS]),
        [camera.projection for camera in CAMERAS],
    )
    for camera, mm, pixels in zip(CAMERAS, points, found, strict=True):
        np.testing.assert_allclose(pixels[:, :2], camera.project(mm), atol=1e-9)
        depth = (mm[:, 2] - camera.distance_mm) * camera.focal_px / camera.distance_mm
        np.testing.assert_allclose(pixels[:, 2], depth, atol=1e-9)


def test_a_configuration_that_is_none_is_one_line(tmp_path: Path) -> None:
    manifest = small_dataset.build_dataset(tmp_path / "d")
    wrong = replace(manifest, configuration={"render": {"resolution": "big"}})
    with pytest.raises(DatasetError, match=r"its configuration cannot be read .*render\.resolution"):
        planned_views(read_heads(tmp_path / "d"), None, wrong, tmp_path / "d")


def test_images_that_are_not_square_keep_their_shape() -> None:
    wide = Fitted.of(200, 100, 50)
    assert (wide.width, wide.height, wide.left, wide.top) == (50, 25, 0, 12)
    np.testing.assert_allclose(wide.points(np.array([[0.0, 0, 7], [200, 100, 7]])), [[0, 12], [50, 37]])
    tile = wide.paste(Image.new("RGB", (200, 100), "red"), "white")
    assert tile.size == (50, 50) and tile.getpixel((25, 25)) == (255, 0, 0)
    assert tile.getpixel((25, 5)) == tile.getpixel((25, 45)) == (255, 255, 255)
    cameras = RowCameras(
        np.eye(3)[None], np.ones((1, 3)), np.array(["perspective"]), *np.array([[200], [100]])
    )
    assert cameras.inside(np.array([[[200.0, 100], [100, 200], [-1, 5]]])).tolist() == [[True, False, False]]


def test_a_sheet_of_wide_images(tmp_path: Path) -> None:
    """A strip is cut off at either side of every image; landmarks stay on the face."""
    manifest = small_dataset.build_dataset(tmp_path / "d")
    for path in (tmp_path / "d" / "images").rglob("*.png"):
        with Image.open(path) as picture:
            shown = picture.crop((16, 0, 48, 64))
        file = io.BytesIO()
        shown.save(file, "PNG")
        path.write_bytes(file.getvalue())
    for part in manifest.parts:
        table = read_part(tmp_path / "d" / part.path)
        landmarks = as_array(table, "landmarks") - np.array([16, 0, 0], np.float32)
        for name, values in (("width", np.full(len(table), 32)), ("landmarks", landmarks)):
            place = table.schema.get_field_index(name)
            field = table.schema.field(place)
            column = pa.array(
                values.reshape(len(table), -1).tolist() if values.ndim > 1 else values, field.type
            )
            table = table.set_column(place, field, column)
        pq.write_table(table, tmp_path / "d" / part.path)
    with Image.open(contact_sheet(tmp_path / "d", manifest, tmp_path / "s.png")) as sheet:
        tile = np.asarray(sheet)[TOP : TOP + TILE, LEFT : LEFT + TILE]
    assert (tile[:, : TILE // 4 - 1] == tile[0, 0]).all(), "paper beside it"
    ys, xs = np.nonzero((tile == [0x19, 0xE3, 0xB1]).all(axis=-1))
    assert DOT == "#19e3b1" and len(xs) > 200
    assert abs(xs.mean() - TILE / 2) < 8 and np.ptp(ys) > 40


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_passes_of_a_wide_image_are_compared_with_the_rows_camera(projection: str) -> None:
    """A wall 600 mm away, 30 wide and 20 high in pixels, seen by a camera whose axis is off its middle."""
    matrix, distance = np.array([[50.0, 0, 12], [0, 50.0, 9], [0, 0, 1]]), 500.0
    shift, size = np.array([[0, 0, distance]]), (np.array([30]), np.array([20]))
    camera = RowCameras(matrix[None], shift, np.array([projection]), *size)
    depth = 600.0 if projection == "perspective" else distance
    x, y = np.meshgrid((np.arange(30) + 0.5 - 12) / 50 * depth, (np.arange(20) + 0.5 - 9) / 50 * depth)
    wall = np.stack([x, y, np.full_like(x, 600.0)], axis=-1)
    assert projection_error_px(wall, camera) < 1e-9
    assert projection_error_px(wall + np.array([depth / 50, 0, 0]), camera) == pytest.approx(1)
    points = wall[[1, 10, 18], [1, 20, 28]]
    seen = np.ones(3, bool)
    assert disagreement(wall[..., 2], points, seen, camera) == 0
    assert disagreement(wall[..., 2], points + np.array([0, 0, 50.0]), seen, camera) > 0
    assert disagreement(wall[..., 2], points - [0, 0, 50.0], ~seen, camera) > 0
