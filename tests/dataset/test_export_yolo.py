# SPDX-License-Identifier: GPL-3.0-or-later
"""yolo-pose against what ultralytics checks of a folder: its code is AGPL and is not run here.

A label lies where the image's last /images/ is /labels/; a line has 5 + 3 x 68 numbers, all of them shares of
the image; data.yaml has train and val, names, kpt_shape and flip_idx, and counts paths from where it lies.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

from generator.dataset.export.options import ExportOptions
from generator.dataset.export.run import export_dataset
from generator.dataset.export.sample import Sample
from generator.dataset.export.yolo_pose import flip_idx, label
from generator.landmarks.topology import FACE_MESH

IBUG_68 = FACE_MESH.ibug_68.indices
MIRRORED = [
    *range(16, -1, -1), *range(26, 16, -1), 27, 28, 29, 30, 35, 34, 33, 32, 31,
    45, 44, 43, 42, 47, 46, 39, 38, 37, 36, 41, 40,
    54, 53, 52, 51, 50, 49, 48, 59, 58, 57, 56, 55, 64, 63, 62, 61, 60, 67, 66, 65,
]  # fmt: skip
"""What iBUG's points become in a mirror, as everybody who trains on 300-W writes it."""


def read(folder: Path, split: str) -> dict[str, tuple[Path, np.ndarray]]:
    """Image -> its file and its label, as ultralytics pairs them."""
    yaml = pytest.importorskip("yaml")
    data = yaml.safe_load((folder / "data.yaml").read_text())
    assert data["kpt_shape"] == [68, 3] and data["names"] == {0: "face"} and "path" not in data
    assert data["flip_idx"] == MIRRORED and len(data["kpt_names"][0]) == 68
    found = {}
    for image in sorted((folder / data[split]).rglob("*.*")):
        before, after = str(image).rsplit("/images/", 1)
        file = Path(before, "labels", after).with_suffix(".txt")
        rows = [line.split() for line in file.read_text().splitlines()]
        values = np.array(rows, dtype=np.float64)
        assert values.shape == (1, 5 + 3 * 68) and values.min() >= 0
        assert values[0, :5].max() <= 1 and values[0, 5:].reshape(68, 3)[:, :2].max() <= 1
        found[image.relative_to(folder).as_posix()] = (image, values[0])
    return found


@pytest.mark.parametrize("landmarks", ["exact", "detected"])
def test_as_ultralytics_reads_it(dataset, tmp_path, landmarks):
    out = tmp_path / "out"
    options = ExportOptions(landmarks, "fail" if landmarks == "exact" else "skip")
    done = export_dataset(dataset, "yolo-pose", out, options)
    assert done.rows == (36 if landmarks == "exact" else 32)
    rows = {row["sample_id"]: row for row in pq.read_table(dataset / "data").to_pylist()}
    facts = {fact["image"]: fact for fact in map(json.loads, (out / "poses.jsonl").read_text().splitlines())}
    seen = 0
    for key, split in (("train", "train"), ("val", "validation")):
        for name, (image, values) in read(out, key).items():
            fact = facts[name]
            row = rows[fact["sample_id"]]
            assert row["split"] == split and fact["license"] == "CC0-1.0"
            assert fact["landmark_source"] == landmarks
            np.testing.assert_allclose(fact["rotation"], row["rotation"], atol=1e-15)
            assert image.read_bytes() == (dataset / row["image_path"]).read_bytes()
            points = values[5:].reshape(68, 3)
            mm = np.array(row["landmarks_exact"]).reshape(468, 3)
            pixels = mm @ np.array(row["camera"]).reshape(3, 3).T
            pixels = pixels[:, :2] / pixels[:, 2:]
            if landmarks == "exact":
                expected = pixels[IBUG_68]
                flags = np.where(np.array(row["landmarks_visible"])[IBUG_68], 2, 1)
            else:
                expected = np.array(row["landmarks"]).reshape(468, 3)[IBUG_68, :2]
                flags = np.full(68, 2)
            inside = ((expected >= 0) & (expected <= 64)).all(axis=1)
            np.testing.assert_allclose(points[inside, :2] * 64, expected[inside], atol=1e-4)
            np.testing.assert_array_equal(points[:, 2], np.where(inside, flags, 0))
            assert (points[~inside] == 0).all()
            middle, size = values[1:3] * 64, values[3:5] * 64
            box = np.clip([np.nanmin(pixels, axis=0), np.nanmax(pixels, axis=0)], 0, 64)
            np.testing.assert_allclose([middle - size / 2, middle + size / 2], box, atol=1e-4)
            with Image.open(image) as picture:
                assert picture.size == (64, 64)
            seen += 1
    assert seen == done.rows == len(facts)
    assert sorted(Path(name).stem for name in facts) == [f"{k:08d}" for k in range(1, seen + 1)]


def test_points_and_faces_beyond_the_image():
    points = np.column_stack([np.linspace(-10, 73, 68), np.full(68, 20.0), np.zeros(68)])
    points[0, 1] = 30.0
    sample = Sample(
        "s", "s", "e", "train", np.zeros(3), np.eye(3), np.eye(3), np.zeros(3), 64, 32, True, points, "exact",
        np.arange(68) % 2 == 0, np.array([-10.0, 20.0, 73.0, 40.0]), b"", ".png",
    )  # fmt: skip
    values = np.array(label(sample).split(), float)
    np.testing.assert_allclose(values[:5], [0, 0.5, 0.8125, 1, 0.375])
    inside = (points[:, 0] >= 0) & (points[:, 0] <= 64)
    np.testing.assert_array_equal(values[7::3], np.where(inside, 2 - np.arange(68) % 2, 0))
    np.testing.assert_allclose(values[5::3], np.where(inside, points[:, 0] / 64, 0), atol=1e-8)
    np.testing.assert_allclose(values[6::3], np.where(inside, points[:, 1] / 32, 0), atol=1e-8)
    assert label(replace(sample, box=np.add(sample.box, [200, 0, 200, 0]))) == "", "a picture without a face"
    assert label(replace(sample, box=None)).split()[1:5] == [
        "0.50000000",
        "0.78125000",
        "1.00000000",
        "0.31250000",
    ]


def test_the_mirror_of_the_mirror(dataset):
    flipped = np.array(flip_idx(FACE_MESH))
    assert (flipped[flipped] == np.arange(68)).all()


def test_a_split_that_is_not_there_is_said(tmp_path, build):
    from small_dataset import HEADS

    build(tmp_path / "d", heads=HEADS[:1])
    export_dataset(tmp_path / "d", "yolo-pose", tmp_path / "out")
    text = (tmp_path / "out" / "data.yaml").read_text()
    assert "# val: ultralytics wants it, and no row is in that split" in text
