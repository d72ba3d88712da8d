# SPDX-License-Identifier: GPL-3.0-or-later
"""Every export is read by somebody else's reader, and R_C is derived again from what was written."""

from __future__ import annotations

import csv
import io
import os
import re
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from generator.dataset.export.fsanet_npz import cropped
from generator.dataset.export.options import ExportOptions
from generator.dataset.export.run import export_dataset
from generator.dataset.export.sample import Sample
from generator.geometry.camera import Camera
from generator.landmarks.topology import FACE_MESH

D = np.diag([1.0, -1.0, -1.0])
IBUG_68 = FACE_MESH.ibug_68.indices


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


@pytest.mark.parametrize("suffix", ["jpg", "png"])
def test_nlml_hpe_as_its_code_looks_for_files(source, rows, tmp_path, suffix):
    chosen = {} if suffix == "jpg" else {"image_format": suffix}
    done = export_dataset(source, "nlml-hpe", tmp_path / "out", ExportOptions(**chosen))
    assert (done.rows, done.heads, done.left_out) == (36, 2, 0)
    with (tmp_path / "out" / "identities.csv").open(newline="") as file:
        subjects = {row["id"]: row["subject"] for row in csv.DictReader(file)}
    found = set()
    for split, expected in (("train", ["1"]), ("validation", ["2"])):
        identities = sorted(os.listdir(tmp_path / "out" / split), key=int)  # every name is a number
        assert identities == expected
        for identity in identities:
            for yaw, pitch, roll in product((-30, 0, 30), (-20, 0, 20), (0, 10)):
                path = tmp_path / "out" / split / identity / f"ID{identity}_({yaw}_{pitch}_{roll}).{suffix}"
                shown = np.asarray(picture(path), float)
                name = f"{subjects[identity]}/neutral/y{yaw:+}_p{pitch:+}_r{roll:+}"
                assert rows[name]["split"] == split
                original = np.asarray(picture(source / rows[name]["image_path"]), float)
                assert np.abs(shown - original).mean() < (3 if suffix == "jpg" else 1e-9)  # the right picture
                angles = [float(angle) for angle in re.findall(r"-?\d+", path.stem.split("_", 1)[1])]
                derived = Rotation.from_euler("XYZ", [-angles[1], angles[0], angles[2]], degrees=True)
                np.testing.assert_allclose(derived.as_matrix(), rotation(rows[name]), atol=1e-12)
                found.add(path)
    assert found == {path for path in (tmp_path / "out").glob("*/*/*")} and len(found) == 36
    if suffix == "jpg":
        with Image.open(found.pop()) as image:
            sampled = {(across, down) for _, across, down, _ in image.layer}
        assert sampled == {(1, 1)}, "colours are as fine as brightness"


@pytest.mark.parametrize("subjects", [("122", "340"), ("facescape-122", "facescape-340")])
def test_facescape_ids_are_kept(tmp_path, build, subjects):
    from small_dataset import HEADS

    heads = tuple(replace(head, subject=name) for head, name in zip(HEADS, subjects, strict=True))
    build(tmp_path / "d", heads=heads)
    export_dataset(tmp_path / "d", "nlml-hpe", tmp_path / "out")
    assert (tmp_path / "out" / "validation" / "340" / "ID340_(0_0_0).jpg").is_file()


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
    build(tmp_path / "d", camera=Camera(96, 64, 85.0, 700.0, "orthographic", (40.0, 36.0)))
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


def test_fsanet_npz_as_its_loaders_take_it(source, rows, tmp_path):
    """d["image"], d["pose"]: FSA-Net's load_data_npz, 6DRepNet's BIWI and our own evaluate."""
    from downstream_hpe.evaluation.photographs import LeftOut, biwi_npz

    export_dataset(source, "fsanet-npz", tmp_path / "out")
    seen = set()
    for split in ("train", "validation"):
        path = tmp_path / "out" / f"{split}.npz"
        with np.load(path, allow_pickle=False) as packed:
            image, pose, names = packed["image"], packed["pose"], packed["name"].tolist()
            assert packed["img_size"] == 64
        assert image.shape == (18, 64, 64, 3) and image.dtype == np.uint8
        for picked, angles, name, photograph in zip(
            image, pose, names, biwi_npz(path, LeftOut()), strict=True
        ):
            row = rows[name]
            assert row["split"] == split
            assert angles.tolist() == [row["yaw_deg"], row["pitch_deg"], row["roll_deg"]]
            np.testing.assert_allclose(photograph.rotation, rotation(row), atol=1e-12)
            np.testing.assert_array_equal(photograph.bgr, picked)
            seen.add(name)
            whole = picture(source / row["image_path"]).convert("RGB")
            x1, y1, x2, y2 = box_of(row)
            wide, high = 0.4 * (x2 - x1), 0.4 * (y2 - y1)
            place = (max(x1 - wide, 0), max(y1 - high, 0), min(x2 + wide, 64), min(y2 + high, 64))
            expected = np.asarray(whole.resize((64, 64), Image.Resampling.BILINEAR, place), int)[..., ::-1]
            assert np.abs(picked - expected).max() <= 1
    assert seen == set(rows)


FRAME = np.pad(np.zeros((62, 62, 3), np.uint8), ((1, 1), (1, 1), (0, 0)), constant_values=255)
"""An image with a white border, which is black inside."""


@pytest.mark.parametrize(
    ("box", "white"),
    [
        (None, "lrtb"),
        ((0, 0, 64, 64), "lrtb"),
        ((-20, -20, 84, 84), "lrtb"),
        ((200, 0, 264, 64), "lrtb"),  # beyond the image: all of it
        ((0, -300, 64, -200), "lrtb"),
        ((14, 14, 49, 49), "lt"),  # 0.4 of its 35 pixels more on each side: 14
        ((15, 15, 50, 50), "rb"),
        ((20, 20, 44, 44), ""),
        ((0, 20, 30, 44), "l"),
        ((34, 20, 64, 44), "r"),
        ((20, 0, 44, 30), "t"),
        ((20, 34, 44, 64), "b"),
        ((44, 0, 64, 14), "rt"),
        ((0, 64.5, 64, 66), "lrtb"),  # a tenth of a pixel of it is in the image
        ((64.5, 0, 66, 64), "lrtb"),
    ],
)
def test_a_face_with_its_margin_ends_where_the_image_does(box, white):
    file = io.BytesIO()
    Image.fromarray(FRAME).save(file, "PNG")
    sample = Sample(
        "s", "s", "e", "train", np.zeros(3), np.eye(3), np.eye(3), np.zeros(3), 64, 64, True, None, "", None,
        None if box is None else np.array(box, float), file.getvalue(), ".png",
    )  # fmt: skip
    found = cropped(sample)
    assert found.shape == (64, 64, 3)
    sides = {"l": found[32, 0], "r": found[32, -1], "t": found[0, 32], "b": found[-1, 32]}
    assert {side for side, pixel in sides.items() if pixel.min() > 100} == set(white)
    assert found[32, 32].max() == 0


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
    seen = set()
    for split, number, subject in (("train", "01", "s1"), ("validation", "02", "s2")):
        folder = tmp_path / "out" / split
        names = (folder / "files.txt").read_text().split()
        assert len(names) == 18 and names[0] == f"{number}/frame_00001"
        assert [path.name for path in folder.iterdir() if path.is_dir()] == [number], "splits do not mix"
        for name in names:
            angles, translation = read_biwi(folder / f"{name}_pose.txt")
            yaw, pitch, roll = np.round(angles).astype(int)
            row = rows[f"{subject}/neutral/y{yaw:+}_p{pitch:+}_r{roll:+}"]
            np.testing.assert_allclose(angles, [row["yaw_deg"], row["pitch_deg"], row["roll_deg"]], atol=1e-9)
            np.testing.assert_allclose(translation, row["translation_mm"])
            derived = Rotation.from_euler("XYZ", [-angles[1], angles[0], angles[2]], degrees=True).as_matrix()
            np.testing.assert_allclose(derived, rotation(row), atol=1e-10)
            shown = np.asarray(picture(folder / f"{name}_rgb.png"))
            np.testing.assert_array_equal(shown, np.asarray(picture(source / row["image_path"])))
            np.testing.assert_allclose(read_dockerface(folder, name), box_of(row), atol=1e-9)
            seen.add(row["sample_id"])
    assert seen == set(rows)
    k = np.loadtxt((tmp_path / "out" / "train" / "01" / "rgb.cal").read_text().splitlines()[:3])
    np.testing.assert_allclose(k.ravel(), row["camera"])


def test_biwi_of_a_wide_image_whose_camera_looks_aside(tmp_path, build):
    build(tmp_path / "d", camera=Camera(96, 64, 85.0, 700.0, principal_px=(40.0, 36.0)))
    export_dataset(tmp_path / "d", "biwi", tmp_path / "out")
    matrix, distortion, turned, moved, size = (
        (tmp_path / "out" / "train" / "01" / "rgb.cal").read_text().split("\n\n")
    )
    k = np.array([row.split() for row in matrix.splitlines()], float)
    assert k[:2, 2].tolist() == [40, 36] and k[0, 0] == k[1, 1] == pytest.approx(85 / 36 * 96)
    assert [float(word) for word in turned.split()] == [1, 0, 0, 0, 1, 0, 0, 0, 1], "the depth camera is this"
    assert (distortion, moved, size) == ("0 0 0 0", "0 0 0", "96 64\n")


def read_dockerface(folder: Path, name: str) -> list[float]:
    """The box as HopeNet finds it: words two to five of the first line of the file beside the image."""
    home, frame = name.split("/")
    words = (folder / f"{home}/dockerface-{frame}_rgb.txt").read_text().splitlines()[0].split(" ")
    assert int(words[0]) == int(frame[-5:])
    return [float(word) for word in words[1:5]]


def box_of(row: dict) -> np.ndarray:
    """The box of the face's exact landmarks in the image."""
    mm = np.array(row["landmarks_exact"]).reshape(468, 3)[:467]  # the last one has no anchor
    image = mm @ np.array(row["camera"]).reshape(3, 3).T
    image = image[:, :2] / image[:, 2:]
    return np.concatenate([image.min(axis=0), image.max(axis=0)])


def test_boxes_without_exact_landmarks(tmp_path, build, monkeypatch):
    """Those of the detector; and where it found nothing, an empty file, by which HopeNet takes all."""
    import small_dataset

    monkeypatch.setattr(small_dataset, "face_anchors", lambda: np.full((468, 3), np.nan))
    heads = tuple(replace(head, anchor_absent=468) for head in small_dataset.HEADS)
    build(tmp_path / "d", heads=heads)
    export_dataset(tmp_path / "d", "biwi", tmp_path / "out")
    rows = pq.read_table(tmp_path / "d" / "data").to_pylist()
    by_angles = {(r["subject"], r["yaw_deg"], r["pitch_deg"], r["roll_deg"]): r for r in rows}
    empty = 0
    for split, subject in (("train", "s1"), ("validation", "s2")):
        folder = tmp_path / "out" / split
        for name in (folder / "files.txt").read_text().split():
            row = by_angles[(subject, *np.round(read_biwi(folder / f"{name}_pose.txt")[0]).tolist())]
            if row["detected"]:
                points = np.array(row["landmarks"]).reshape(468, 3)[:, :2]
                expected = [*points.min(axis=0), *points.max(axis=0)]
                np.testing.assert_allclose(read_dockerface(folder, name), expected, atol=1e-5)
            else:
                home, frame = name.split("/")
                empty += (folder / home / f"dockerface-{frame}_rgb.txt").read_text() == ""
    assert empty == 4
    assert "4 of 36" in (tmp_path / "out" / "README.md").read_text()
