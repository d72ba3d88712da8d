# SPDX-License-Identifier: GPL-3.0-or-later
"""webdataset and tfrecord, read by the packages of these names, and what is in them."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import tarfile
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

from generator.dataset.export import shards
from generator.dataset.export.crc32c import crc32c
from generator.dataset.export.options import ExportOptions
from generator.dataset.export.run import export_dataset
from generator.dataset.export.tfrecord import example
from generator.landmarks.topology import FACE_MESH

IBUG_68 = FACE_MESH.ibug_68.indices


@pytest.fixture(scope="module")
def rows(source) -> dict[str, dict]:
    """The table itself, by sample_id."""
    return {row["sample_id"]: row for row in pq.read_table(source / "data").to_pylist()}


def check(record: dict, row: dict, landmarks: str, float32: bool = False) -> None:
    """A record says what its row says, to a hair or as float32 does."""
    close = {"rtol": 1e-6, "atol": 1e-5} if float32 else {"rtol": 0, "atol": 1e-9}
    for name in ("sample_id", "subject", "expression", "split", "width", "height", "detected"):
        assert record[name] == row[name], name
    assert (record["license"], record["redistributable"]) == ("CC0-1.0", True)
    for name in ("rotation", "camera", "translation_mm"):
        np.testing.assert_allclose(record[name], row[name], **close)
    assert list(record["angles_deg"]) == [row["yaw_deg"], row["pitch_deg"], row["roll_deg"]]
    mm = np.array(row["landmarks_exact"]).reshape(468, 3)
    pixels = mm @ np.array(row["camera"]).reshape(3, 3).T
    pixels = pixels[:, :2] / pixels[:, 2:]
    expected_box = [*np.nanmin(pixels, axis=0), *np.nanmax(pixels, axis=0)]
    np.testing.assert_allclose(record["box"], expected_box, **close)
    if landmarks == "detected" and not row["detected"]:
        assert record["landmark_source"] == "" and "landmarks" not in record and "visible" not in record
        return
    assert record["landmark_source"] == landmarks
    points = np.array(record["landmarks"]).reshape(68, 3)
    if landmarks == "exact":
        np.testing.assert_allclose(points[:, :2], pixels[IBUG_68], **close)
        np.testing.assert_array_equal(record["visible"], np.array(row["landmarks_visible"])[IBUG_68])
    else:
        np.testing.assert_allclose(points, np.array(row["landmarks"]).reshape(468, 3)[IBUG_68], atol=1e-6)
        assert "visible" not in record


@pytest.mark.parametrize("landmarks", ["exact", "detected"])
def test_a_row_is_an_image_and_a_json_of_one_key(source, rows, tmp_path, landmarks):
    done = export_dataset(source, "webdataset", tmp_path / "out", ExportOptions(landmarks))
    assert (done.rows, done.left_out, done.filled) == (36, 0, 0), "a row without landmarks is kept"
    seen = set()
    for split in ("train", "validation"):
        with tarfile.open(tmp_path / "out" / f"{split}-000000.tar") as archive:
            members = archive.getmembers()
            numbers = range(1, 19) if split == "train" else range(19, 37)
            assert [member.name[:8] for member in members[::2]] == [f"{k:08d}" for k in numbers]
            for image, label in zip(members[::2], members[1::2], strict=True):
                key, suffix = image.name.split(".", 1)  # as the package does: a key has no dot
                assert (suffix, label.name) == ("png", f"{key}.json")
                record = json.loads(archive.extractfile(label).read())
                row = rows[record["sample_id"]]
                assert row["split"] == split
                check(record, row, landmarks)
                assert archive.extractfile(image).read() == (source / row["image_path"]).read_bytes()
                seen.add(record["sample_id"])
    assert seen == set(rows)


def test_shards_end_when_they_are_large(source, rows, tmp_path, monkeypatch):
    monkeypatch.setattr(shards, "SHARD_BYTES", 50_000)
    export_dataset(source, "webdataset", tmp_path / "out")
    files = sorted(path.name for path in (tmp_path / "out").glob("train-*.tar"))
    assert len(files) > 2 and files == [f"train-{k:06d}.tar" for k in range(len(files))]
    text = (tmp_path / "out" / "README.md").read_text()
    assert f"`train-{{000000..{len(files) - 1:06d}}}.tar` | 18 |" in text
    names: list[str] = []
    for path in sorted((tmp_path / "out").glob("*.tar")):
        with tarfile.open(path) as archive:
            names += archive.getnames()
    assert len(names) == len(set(names)) == 72


WEBDATASET = """
import json
import sys
sys.modules["torch"] = None  # it is imported where it can be, for seconds, and not needed
import numpy as np
import webdataset as wds
rows = wds.WebDataset(sys.argv[1], shardshuffle=False).decode("rgb8").to_tuple("png;jpg", "json")
images, records = zip(*rows)
np.savez(sys.argv[2], images=np.array(images), records=json.dumps(records))
"""


@pytest.mark.slow
def test_webdataset_streams_it(source, rows, tmp_path, monkeypatch):
    pytest.importorskip("webdataset")
    monkeypatch.setattr(shards, "SHARD_BYTES", 50_000)
    export_dataset(source, "webdataset", tmp_path / "out")
    last = len(list((tmp_path / "out").glob("train-*.tar"))) - 1
    urls = f"{tmp_path}/out/train-{{000000..{last:06d}}}.tar"
    script = [sys.executable, "-c", WEBDATASET, urls, str(tmp_path / "rows.npz")]
    done = subprocess.run(
        script, capture_output=True, text=True
    )  # a process of its own: it leaves files open
    assert done.returncode == 0, done.stderr
    seen = []
    with np.load(tmp_path / "rows.npz") as read:
        for image, record in zip(read["images"], json.loads(str(read["records"])), strict=True):
            row = rows[record["sample_id"]]
            check(record, row, "exact")
            with Image.open(source / row["image_path"]) as original:
                np.testing.assert_array_equal(image, np.asarray(original.convert("RGB")))
            seen.append(record["sample_id"])
    assert sorted(seen) == sorted(name for name, row in rows.items() if row["split"] == "train")


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"", 0),
        (b"123456789", 0xE3069283),
        (bytes(32), 0x8A9136AA),
        (b"\xff" * 32, 0x62A8AB43),
        (bytes(range(32)), 0x46DD794E),
    ],
)
def test_crc32c_of_rfc_3720(data, expected):
    assert crc32c(data) == expected


@pytest.mark.parametrize("size", [1, 255, 256, 257, 512, 70_001])
def test_crc32c_row_by_row_is_that_bit_by_bit(size):
    data = np.random.default_rng(size).bytes(size)
    crc = 0xFFFFFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0x82F63B78 if crc & 1 else 0)
    assert crc32c(data) == crc ^ 0xFFFFFFFF


TFRECORD = """
import sys
sys.modules["torch"] = None  # as above
import numpy as np
from tfrecord.reader import tfrecord_loader
array = lambda value: np.frombuffer(value, np.uint8) if isinstance(value, bytes) else np.asarray(value)
rows = [{name: array(value) for name, value in row.items()} for row in tfrecord_loader(sys.argv[1], None)]
arrays = {f"{k}.{name}": value for k, row in enumerate(rows) for name, value in row.items()}
np.savez(sys.argv[2], count=len(rows), **arrays)
"""


@pytest.mark.slow
@pytest.mark.parametrize("landmarks", ["exact", "detected"])
def test_tfrecord_reads_it(source, rows, tmp_path, landmarks):
    pytest.importorskip("tfrecord")
    export_dataset(source, "tfrecord", tmp_path / "out", ExportOptions(landmarks))
    seen = set()
    for split in ("train", "validation"):
        file = str(tmp_path / "out" / f"{split}-000000.tfrecord")
        script = [sys.executable, "-c", TFRECORD, file, str(tmp_path / "rows.npz")]
        done = subprocess.run(script, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        with np.load(tmp_path / "rows.npz") as read:
            assert read["count"] == 18
            for k in range(18):
                record = {
                    name.split(".", 1)[1]: read[name] for name in read.files if name.startswith(f"{k}.")
                }
                seen.add(as_record(record, rows, source, landmarks))
    assert seen == set(rows)


def as_record(record: dict, rows: dict[str, dict], source: Path, landmarks: str) -> str:
    """Compare the features of one Example, arrays, with its row; its sample_id."""
    for name in ("image_format", "sample_id", "subject", "expression", "split", "license", "landmark_source"):
        record[name] = record[name].tobytes().decode()
    row = rows[record["sample_id"]]
    assert record.pop("image").tobytes() == (source / row["image_path"]).read_bytes()
    assert record.pop("image_format") == "png"
    for name in ("width", "height", "detected", "redistributable"):
        assert record[name].dtype == np.int64
        record[name] = record[name].item()
    for name in ("rotation", "camera", "translation_mm", "box", "landmarks"):
        if name in record:
            assert record[name].dtype == np.float32
    assert np.abs(record["rotation"] - row["rotation"]).max() < 1e-7
    check(record, row, landmarks, float32=True)
    return row["sample_id"]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (b"xy", "0a0d 0a0b 0a0161 1206 0a04 0a02 7879"),
        ("é", "0a0d 0a0b 0a0161 1206 0a04 0a02 c3a9"),
        ([1, 300], "0a0e 0a0c 0a0161 1207 1a05 0a03 01 ac02"),
        (127, "0a0c 0a0a 0a0161 1205 1a03 0a01 7f"),
        (128, "0a0d 0a0b 0a0161 1206 1a04 0a02 8001"),
        (True, "0a0c 0a0a 0a0161 1205 1a03 0a01 01"),
        (-1, "0a15 0a13 0a0161 120e 1a0c 0a0a ffffffffffffffffff01"),
        (0.5, "0a0f 0a0d 0a0161 1208 1206 0a04 0000003f"),
        ([0.5, 1], "0a13 0a11 0a0161 120c 120a 0a08 0000003f 0000803f"),
    ],
)
def test_an_example_is_what_protobuf_makes_of_it(value, expected):
    """features { feature { key: "a", value { bytes_list, float_list or int64_list } } }, by its encoding."""
    assert example({"a": value}) == bytes.fromhex(expected)


def test_a_tfrecord_file_is_framed_as_tensorflow_frames_it(source, tmp_path):
    """Length, its masked checksum, the Example, its masked checksum: TensorFlow checks both."""
    export_dataset(source, "tfrecord", tmp_path / "out")
    data = (tmp_path / "out" / "train-000000.tfrecord").read_bytes()
    place = count = 0
    while place < len(data):
        length, check_of_length = struct.unpack_from("<QI", data, place)
        body = data[place + 12 : place + 12 + length]
        [check_of_body] = struct.unpack_from("<I", data, place + 12 + length)
        for part, stored in ((data[place : place + 8], check_of_length), (body, check_of_body)):
            unmasked = stored - 0xA282EAD8 & 0xFFFFFFFF
            assert (unmasked >> 17 | unmasked << 15) & 0xFFFFFFFF == crc32c(part)
        place, count = place + 16 + length, count + 1
    assert (place, count) == (len(data), 18)
