# SPDX-License-Identifier: GPL-3.0-or-later
"""The dataset is read with no code of ours: the exact lines of the dataset card."""

from __future__ import annotations

import hashlib
import io
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from generator.geometry.rotation import rotation_from_angles

pytestmark = pytest.mark.slow

NAMES = ("yaw_deg", "pitch_deg", "roll_deg")


def check(angles: np.ndarray, rotation: np.ndarray, landmarks: np.ndarray, detected: np.ndarray) -> None:
    """All 36 rows arrived, with labels that agree, whatever their order."""
    assert angles.shape == (36, 3) and rotation.shape == (36, 9) and landmarks.shape == (36, 1404)
    assert angles.dtype == np.float64 and landmarks.dtype == np.float32
    assert len(np.unique(angles, axis=0)) == 18
    np.testing.assert_array_equal(rotation.reshape(-1, 3, 3), rotation_from_angles(angles))
    np.testing.assert_array_equal(np.isnan(landmarks).all(axis=1), ~detected)
    np.testing.assert_array_equal(np.isfinite(landmarks).all(axis=1), detected)
    assert detected.sum() == 32


def check_image(image: Image.Image) -> None:
    assert image.size == (64, 64) and image.getpixel((0, 0)) == (128, 128, 128)


@pytest.fixture(scope="module")
def embedded(tmp_path_factory, build) -> Path:
    root = tmp_path_factory.mktemp("readers") / "seed=7" / "subject=x" / "dataset"
    build(root, "embedded", twins=("jpeg",))
    return root


def test_pandas(embedded):
    pd = pytest.importorskip("pandas")
    rows = pd.read_parquet(embedded / "data")
    check(
        rows[list(NAMES)].to_numpy(),
        np.stack(rows["rotation"]),
        np.stack(rows["landmarks"]),
        rows["detected"].to_numpy(),
    )
    first = rows.iloc[0]
    assert hashlib.sha256(first["image"]["bytes"]).hexdigest() == first["image_sha256"]
    check_image(Image.open(io.BytesIO(first["image"]["bytes"])))
    assert len(pd.read_parquet(embedded / "data" / "train")) == 18
    assert pd.read_parquet(embedded / "heads.parquet")["subject"].tolist() == ["s1", "s2"]


@pytest.mark.parametrize("pattern", ["data/**/*.parquet", "data"])
def test_polars(embedded, pattern):
    pl = pytest.importorskip("polars")
    rows = pl.read_parquet(embedded / pattern)
    assert rows.schema["rotation"] == pl.Array(pl.Float64, 9)
    check(
        rows.select(NAMES).to_numpy(),
        rows["rotation"].to_numpy(),
        rows["landmarks"].to_numpy(),
        rows["detected"].to_numpy(),
    )
    check_image(Image.open(io.BytesIO(rows["image"][0]["bytes"])))


def test_duckdb(embedded):
    duckdb = pytest.importorskip("duckdb")
    # Of itself it makes columns of folders that are called key=value.
    files = f"read_parquet('{embedded}/data/**/*.parquet', hive_partitioning=false)"
    with duckdb.connect() as connection:
        rows = connection.sql(f"SELECT * FROM {files}").fetchnumpy()
        found = connection.sql(
            f"SELECT count(*) FROM {files} WHERE detected AND abs(yaw_deg) <= 20"
        ).fetchall()
    assert rows["subject"][0] in ("s1", "s2") and "seed" not in rows
    check(
        np.stack([rows[name] for name in NAMES], axis=1),
        np.array(rows["rotation"].tolist()),
        np.array(rows["landmarks"].tolist(), dtype=np.float32),
        rows["detected"],
    )
    assert found == [(12,)]
    check_image(Image.open(io.BytesIO(rows["image"][0]["bytes"])))


HUGGING_FACE = """
import json, sys
import numpy as np
from datasets import Image, load_dataset
rows = load_dataset(sys.argv[1])
assert {name: len(split) for name, split in rows.items()} == {"train": 18, "validation": 18}, rows
assert isinstance(rows["train"].features["image"], Image), rows["train"].features
image = rows["train"][0]["image"]
assert image.size == (64, 64) and image.getpixel((0, 0)) == (128, 128, 128)
twins = load_dataset(sys.argv[1], "twins")
assert all(set(twins[name]["factor"]) == {"jpeg"} for name in ("train", "validation")), twins
assert len(twins["train"]) == 18 and twins["train"][0]["twin_of"] + "~jpeg" == twins["train"][0]["sample_id"]
assert load_dataset(sys.argv[1], "heads")["train"]["subject"][:] == ["s1", "s2"]
names = ("yaw_deg", "pitch_deg", "roll_deg")
both = [rows["train"], rows["validation"]]  # not with_format("numpy"): that narrows float64 to float32
join = lambda name: np.concatenate([np.array(split[name][:]) for split in both])
np.savez(sys.argv[2], angles=np.stack([join(n) for n in names], axis=1), rotation=join("rotation"),
         landmarks=join("landmarks").astype(np.float32), detected=join("detected"))
"""


def test_hugging_face_datasets(embedded, tmp_path):
    pytest.importorskip("datasets")
    offline = {"HF_HOME": str(tmp_path / "hf"), "HF_HUB_OFFLINE": "1", "HF_DATASETS_OFFLINE": "1"}
    # In a process of its own: datasets reads its cache folder and offline mode when it is imported.
    done = subprocess.run(
        [sys.executable, "-c", HUGGING_FACE, str(embedded), str(tmp_path / "rows.npz")],
        capture_output=True,
        text=True,
        env={**os.environ, **offline},
    )
    assert done.returncode == 0, done.stderr
    with np.load(tmp_path / "rows.npz") as rows:
        check(rows["angles"], rows["rotation"], rows["landmarks"], rows["detected"])
