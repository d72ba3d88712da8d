# SPDX-License-Identifier: GPL-3.0-or-later
"""Exports read by the programs they are for: pycocotools, Hugging Face datasets, mlcroissant."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

from generator.dataset.export.run import export_dataset
from generator.landmarks.topology import FACE_MESH

pytestmark = pytest.mark.slow

IBUG_68 = FACE_MESH.ibug_68.indices


@pytest.fixture(scope="module")
def rows(source) -> dict[str, dict]:
    """The table itself, by sample_id."""
    return {row["sample_id"]: row for row in pq.read_table(source / "data").to_pylist()}


def picture(path: Path) -> Image.Image:
    with Image.open(path) as image:
        assert image.size == (64, 64)
        return image.copy()


def test_coco_read_by_pycocotools(source, rows, tmp_path, capsys):
    coco_module = pytest.importorskip("pycocotools.coco")
    export_dataset(source, "coco", tmp_path / "out")
    seen = set()
    for split in ("train", "validation"):
        coco = coco_module.COCO(str(tmp_path / "out" / "annotations" / f"{split}.json"))
        assert len(coco.getImgIds()) == 18
        category = coco.loadCats(coco.getCatIds(["face"]))[0]
        assert len(category["keypoints"]) == 68
        assert {k for line in category["skeleton"] for k in line} <= set(range(1, 69))
        for annotation in coco.loadAnns(coco.getAnnIds(catIds=[1], iscrowd=False)):
            image = coco.loadImgs(annotation["image_id"])[0]
            row = rows[image["file_name"].removesuffix(".png")]
            seen.add(row["sample_id"])
            picture(tmp_path / "out" / "images" / split / image["file_name"])
            np.testing.assert_allclose(annotation["rotation"], row["rotation"], atol=1e-15)
            keypoints = np.array(annotation["keypoints"]).reshape(68, 3)
            visible = np.array(row["landmarks_visible"])[IBUG_68]
            np.testing.assert_array_equal(keypoints[:, 2], np.where(visible, 2, 1))
            assert 0 < visible.sum() < 68
            mm = np.array(row["landmarks_exact"]).reshape(468, 3)[IBUG_68]
            projected = mm @ np.array(row["camera"]).reshape(3, 3).T
            np.testing.assert_allclose(keypoints[:, :2], projected[:, :2] / projected[:, 2:], atol=1e-9)
            x, y, width, height = annotation["bbox"]
            assert annotation["area"] == pytest.approx(width * height)
            np.testing.assert_allclose([x, y], keypoints[:, :2].min(axis=0))
    assert seen == set(rows)


HUGGING_FACE = """
import sys
import numpy as np
from datasets import Features, Image, List, Value, load_dataset
rows = load_dataset(sys.argv[1])
assert {name: len(split) for name, split in rows.items()} == {"train": 18, "validation": 18}, rows
features = rows["train"].features
assert isinstance(features["image"], Image), features
assert features["rotation"] == List(Value("float64"), length=9), features
assert features["landmarks_exact"] == List(Value("float32"), length=1404), features
assert features["detected"] == Value("bool"), features
assert rows["train"][0]["image"].size == (64, 64)
assert load_dataset(sys.argv[1], "heads")["train"]["subject"][:] == ["s1", "s2"]
both = [rows["train"], rows["validation"]]
join = lambda name: np.concatenate([np.array(split[name][:]) for split in both])
np.savez(sys.argv[2], **{name: join(name) for name in ("sample_id", "rotation", "landmarks", "detected")})
"""


@pytest.mark.parametrize("images", ["files", "embedded"])
def test_huggingface_read_offline_by_datasets(tmp_path, build, images):
    pytest.importorskip("datasets")
    build(tmp_path / "d", images)
    export_dataset(tmp_path / "d", "huggingface", tmp_path / "out")
    offline = {"HF_HOME": str(tmp_path / "hf"), "HF_HUB_OFFLINE": "1", "HF_DATASETS_OFFLINE": "1"}
    done = subprocess.run(
        [sys.executable, "-c", HUGGING_FACE, str(tmp_path / "out"), str(tmp_path / "rows.npz")],
        capture_output=True,
        text=True,
        env={**os.environ, **offline},
    )
    assert done.returncode == 0, done.stderr
    table = {row["sample_id"]: row for row in pq.read_table(tmp_path / "d" / "data").to_pylist()}
    with np.load(tmp_path / "rows.npz") as read:
        assert set(read["sample_id"]) == set(table)
        for name, matrix, landmarks in zip(
            read["sample_id"], read["rotation"], read["landmarks"], strict=True
        ):
            np.testing.assert_array_equal(matrix, table[name]["rotation"])
            np.testing.assert_array_equal(landmarks, table[name]["landmarks"])


def test_the_cards_front_matter_is_what_datasets_would_write(source, tmp_path):
    datasets = pytest.importorskip("datasets")
    yaml = pytest.importorskip("yaml")
    export_dataset(source, "huggingface", tmp_path / "out")
    text = (tmp_path / "out" / "README.md").read_text()
    front = yaml.safe_load(text.split("---")[1])
    assert front["license"] == "cc0-1.0"
    schema = pq.read_schema(next((tmp_path / "out" / "data" / "train").iterdir()))
    from_schema = datasets.Features.from_arrow_schema(schema)
    assert datasets.Features._from_yaml_list(front["dataset_info"][0]["features"]) == from_schema
    assert "A. Person" in text and "CC0-1.0" in text and "36 of 36" in text


CROISSANT = """
import sys
import numpy as np
import mlcroissant as mlc
dataset = mlc.Dataset(sys.argv[1] + "/croissant.json")
assert not dataset.metadata.ctx.issues.errors, dataset.metadata.ctx.issues.report()
warnings = dataset.metadata.ctx.issues.warnings
assert len(warnings) == 1 and "datePublished" in list(warnings)[0], warnings  # the publisher's to say
rows = list(dataset.records("rows"))
assert rows[0]["rows/image"].size == (64, 64)
text = lambda value: value.decode() if isinstance(value, bytes) else value
np.savez(sys.argv[2], sample_id=[text(row["rows/sample_id"]) for row in rows],
         rotation=[row["rows/rotation"] for row in rows], detected=[row["rows/detected"] for row in rows])
"""


def test_croissant_read_by_mlcroissant(source, rows, tmp_path):
    pytest.importorskip("mlcroissant")
    export_dataset(source, "croissant", tmp_path / "out")
    done = subprocess.run(  # a process of its own: its dependencies warn when imported
        [sys.executable, "-c", CROISSANT, str(tmp_path / "out"), str(tmp_path / "rows.npz")],
        capture_output=True,
        text=True,
        env={**os.environ, "HOME": str(tmp_path)},
    )
    assert done.returncode == 0, done.stderr
    assert "not standard" not in done.stderr
    with np.load(tmp_path / "rows.npz") as read:
        assert set(read["sample_id"]) == set(rows)
        for name, matrix, detected in zip(read["sample_id"], read["rotation"], read["detected"], strict=True):
            np.testing.assert_array_equal(matrix, rows[name]["rotation"])
            assert detected == rows[name]["detected"]
