# SPDX-License-Identifier: GPL-3.0-or-later
"""Every export is read by somebody else's reader, and R_C is derived again from what was written."""

from __future__ import annotations

import csv
import io
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from generator.dataset.export.options import ExportOptions
from generator.dataset.export.run import export_dataset
from generator.geometry.camera import Camera
from generator.landmarks.topology import FACE_MESH
from generator.registries import FORMATS

D = np.diag([1.0, -1.0, -1.0])
IBUG_68 = FACE_MESH.ibug_68.indices


@pytest.fixture(scope="module")
def source(tmp_path_factory, build) -> Path:
    """2 heads x 18 poses with exact landmarks, images as files; two misses a head."""
    root = tmp_path_factory.mktemp("export") / "dataset"
    build(root)
    return root


@pytest.fixture(scope="module")
def rows(source) -> dict[str, dict]:
    """The table itself, by sample_id."""
    return {row["sample_id"]: row for row in pq.read_table(source / "data").to_pylist()}


def rotation(row: dict) -> np.ndarray:
    return np.array(row["rotation"]).reshape(3, 3)


def picture(path: Path) -> Image.Image:
    with Image.open(path) as image:
        assert image.size == (64, 64)
        return image.copy()


def test_nlml_hpe_as_its_code_looks_for_files(source, rows, tmp_path):
    done = export_dataset(source, "nlml-hpe", tmp_path / "out")
    assert (done.rows, done.heads, done.left_out) == (36, 2, 0)
    identities = sorted((p.name for p in (tmp_path / "out").iterdir() if p.is_dir()), key=int)
    assert identities == ["1", "2"]
    with (tmp_path / "out" / "identities.csv").open(newline="") as file:
        subjects = {row["id"]: row["subject"] for row in csv.DictReader(file)}
    found = 0
    for identity in identities:
        for yaw in np.arange(-30, 31, 30):
            for pitch in np.arange(-20, 21, 20):
                for roll in np.arange(0, 11, 10):
                    path = tmp_path / "out" / identity / f"ID{identity}_({yaw}_{pitch}_{roll}).jpg"
                    shown = np.asarray(picture(path), float)
                    name = f"{subjects[identity]}/neutral/y{yaw:+}_p{pitch:+}_r{roll:+}"
                    original = np.asarray(picture(source / rows[name]["image_path"]), float)
                    assert np.abs(shown - original).mean() < 3  # JPEG, and the right picture
                    angles = [float(angle) for angle in re.findall(r"-?\d+", path.stem.split("_", 1)[1])]
                    derived = Rotation.from_euler("XYZ", [-angles[1], angles[0], angles[2]], degrees=True)
                    np.testing.assert_allclose(derived.as_matrix(), rotation(rows[name]), atol=1e-12)
                    found += 1
    assert found == 36


def test_facescape_ids_are_kept(tmp_path, build):
    from small_dataset import HEADS

    heads = tuple(replace(head, subject=name) for head, name in zip(HEADS, ("122", "340"), strict=True))
    build(tmp_path / "d", heads=heads)
    export_dataset(tmp_path / "d", "nlml-hpe", tmp_path / "out")
    assert (tmp_path / "out" / "340" / "ID340_(0_0_0).jpg").is_file()


@pytest.mark.parametrize("landmarks", ["exact", "detected"])
def test_300w_lp_read_by_scipy(source, rows, tmp_path, landmarks):
    sio = pytest.importorskip("scipy.io")
    missing = "fail" if landmarks == "exact" else "skip"
    done = export_dataset(source, "300w-lp", tmp_path / "out", ExportOptions(landmarks, missing))
    assert (done.rows, done.left_out) == ((36, 0) if landmarks == "exact" else (32, 4))
    names = (tmp_path / "out" / "files.txt").read_text().split()
    assert len(set(names)) == done.rows
    for name in names:
        mat = sio.loadmat(tmp_path / "out" / f"{name}.mat")
        split, subject, expression = re.fullmatch(r"(\w+)/(\w+)_(\w+?)_y.*", name).groups()
        row = rows[f"{subject}/{expression}/{name[name.index('_y') + 1 :]}"]
        assert row["split"] == split
        pitch, yaw, roll, tx, ty, _, scale = mat["Pose_Para"][0]
        u = Rotation.from_euler("XYZ", [-pitch, -yaw, -roll]).as_matrix()
        np.testing.assert_allclose(D @ u @ D, rotation(row), atol=1e-12)
        assert mat["landmark_source"] == [landmarks]
        points, translation = mat["pt3d_68"].T, np.array(row["translation_mm"])
        np.testing.assert_array_equal(mat["pt2d"].T, points[:, :2])
        assert (mat["roi"][0, :2] <= points[:, :2].min(axis=0)).all()
        assert (mat["roi"][0, 2:] >= points[:, :2].max(axis=0)).all()
        picture(tmp_path / "out" / f"{name}.jpg")
        k = np.array(row["camera"]).reshape(3, 3)
        if landmarks == "detected":
            expected = np.array(row["landmarks"]).reshape(468, 3)[IBUG_68]
            np.testing.assert_allclose(points, expected * [1, 1, -1], atol=1e-4)
            continue
        mm = np.array(row["landmarks_exact"]).reshape(468, 3)[IBUG_68]
        image = mm @ k.T
        np.testing.assert_allclose(points[:, :2], image[:, :2] / image[:, 2:], atol=1e-9)
        # scale * R_U X + t is 3DDFA's weak perspective, y up: right at the pivot's depth.
        head = (mm - translation) @ rotation(row) @ D
        weak = scale * head @ u.T + [tx, ty, 0]
        depth = mm[:, 2:] / translation[2]
        np.testing.assert_allclose((points[:, 0] - 32) * depth[:, 0], weak[:, 0] - 32, atol=1e-4)
        np.testing.assert_allclose((64 - points[:, 1] - 32) * depth[:, 0], weak[:, 1] - 32, atol=1e-4)
        np.testing.assert_allclose(points[:, 2], weak[:, 2], atol=1e-4)


def test_300w_lp_of_an_orthographic_camera_is_weak_perspective_itself(tmp_path, build):
    sio = pytest.importorskip("scipy.io")
    build(tmp_path / "d", camera=Camera.square(64, 85.0, 700.0, "orthographic"))
    export_dataset(tmp_path / "d", "300w-lp", tmp_path / "out")
    rows = {row["sample_id"]: row for row in pq.read_table(tmp_path / "d" / "data").to_pylist()}
    row = rows["s1/neutral/y-30_p+20_r+10"]
    mat = sio.loadmat(tmp_path / "out" / "train" / "s1_neutral_y-30_p+20_r+10.mat")
    pitch, yaw, roll, tx, ty, tz, scale = mat["Pose_Para"][0]
    u = Rotation.from_euler("XYZ", [-pitch, -yaw, -roll]).as_matrix()
    mm = np.array(row["landmarks_exact"]).reshape(468, 3)[IBUG_68] - row["translation_mm"]
    weak = scale * mm @ rotation(row) @ D @ u.T + [tx, ty, tz]
    np.testing.assert_allclose(mat["pt3d_68"].T * [1, -1, 1] + [0, 64, 0], weak, atol=1e-4)


def get_r(pitch: float, yaw: float, roll: float) -> np.ndarray:
    """6DRepNet's utils.get_R: Rz Ry Rx of radians."""
    rx, ry, rz = (Rotation.from_euler(axis, angle).as_matrix() for axis, angle in
                  zip("xyz", (pitch, yaw, roll), strict=True))  # fmt: skip
    return rz @ ry @ rx


def test_6drepnet_labels(source, rows, tmp_path):
    export_dataset(source, "6drepnet", tmp_path / "out")
    with np.load(tmp_path / "out" / "labels.npz", allow_pickle=False) as labels:
        values = {name: labels[name] for name in labels.files}
    assert set(values["name"]) == set(rows)
    text = {}
    for split in ("train", "validation"):
        for line in (tmp_path / "out" / f"labels_{split}.txt").read_text().splitlines():
            image, *numbers = line.split(" ")
            text[image] = np.array(numbers, float).reshape(3, 3)
    for name, image, matrix, six in zip(
        values["name"], values["image"], values["R"], values["ortho6d"], strict=True
    ):
        row = rows[name]
        expected = get_r(*np.deg2rad([row["pitch_deg"], row["yaw_deg"], row["roll_deg"]]))
        np.testing.assert_allclose(matrix, expected, atol=1e-12)
        np.testing.assert_allclose(D @ matrix.T @ D, rotation(row), atol=1e-12)
        # compute_rotation_matrix_from_ortho6d
        x = six[:3] / np.linalg.norm(six[:3])
        z = np.cross(x, six[3:])
        z /= np.linalg.norm(z)
        np.testing.assert_allclose(np.stack([x, np.cross(z, x), z], axis=1), expected, atol=1e-12)
        np.testing.assert_array_equal(text[image], matrix)
        assert (tmp_path / "out" / image).read_bytes() == (source / row["image_path"]).read_bytes()


def read_biwi(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Angles (yaw, pitch, roll) as HopeNet's and FSA-Net's BIWI readers take them, and the translation."""
    lines = [[float(word) for word in line.split()] for line in path.read_text().splitlines() if line.strip()]
    m = np.array(lines[:3]).T
    roll = -np.arctan2(m[1][0], m[0][0])
    yaw = -np.arctan2(-m[2][0], np.sqrt(m[2][1] ** 2 + m[2][2] ** 2))
    pitch = np.arctan2(m[2][1], m[2][2])
    return np.rad2deg([yaw, pitch, roll]), np.array(lines[3])


def test_biwi_as_its_readers_take_it(source, rows, tmp_path):
    export_dataset(source, "biwi", tmp_path / "out")
    names = (tmp_path / "out" / "files.txt").read_text().split()
    assert len(names) == 36 and names[0] == "01/frame_00001"
    seen = set()
    for name in names:
        angles, translation = read_biwi(tmp_path / "out" / f"{name}_pose.txt")
        subject = {"01": "s1", "02": "s2"}[name[:2]]
        yaw, pitch, roll = np.round(angles).astype(int)
        row = rows[f"{subject}/neutral/y{yaw:+}_p{pitch:+}_r{roll:+}"]
        np.testing.assert_allclose(angles, [row["yaw_deg"], row["pitch_deg"], row["roll_deg"]], atol=1e-9)
        np.testing.assert_allclose(translation, row["translation_mm"])
        derived = Rotation.from_euler("XYZ", [-angles[1], angles[0], angles[2]], degrees=True).as_matrix()
        np.testing.assert_allclose(derived, rotation(row), atol=1e-10)
        shown = np.asarray(picture(tmp_path / "out" / f"{name}_rgb.png"))
        np.testing.assert_array_equal(shown, np.asarray(picture(source / row["image_path"])))
        seen.add(row["sample_id"])
    assert seen == set(rows)
    k = np.loadtxt((tmp_path / "out" / "01" / "rgb.cal").read_text().splitlines()[:3])
    np.testing.assert_allclose(k.ravel(), row["camera"])


@pytest.mark.parametrize("name", FORMATS)
def test_two_exports_are_the_same_bytes(source, tmp_path, name):
    for out in ("a", "b"):
        export_dataset(source, name, tmp_path / out)
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert files
    for file in files:
        if file.suffix != ".mat":  # MATLAB's header holds the time
            assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    assert (tmp_path / "a" / "README.md").is_file()


def test_images_come_from_the_table_where_they_are_embedded(tmp_path, build):
    build(tmp_path / "d", "embedded")
    export_dataset(tmp_path / "d", "biwi", tmp_path / "out")
    row = pq.read_table(tmp_path / "d" / "data").to_pylist()[0]
    written = (tmp_path / "out" / "01" / "frame_00001_rgb.png").read_bytes()
    assert written == row["image"]["bytes"]
    assert Image.open(io.BytesIO(written)).size == (64, 64)
