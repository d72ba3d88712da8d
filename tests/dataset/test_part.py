# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from generator.dataset.format.columns import SCHEMA_VERSION
from generator.dataset.format.digest import add_digests, content_digest
from generator.dataset.format.open import as_array
from generator.dataset.format.part import check_part, commit_unit, read_part, write_part
from generator.dataset.format.schema import part_schema
from generator.dataset.format.unit_rows import unit_table
from generator.errors import DatasetError
from generator.geometry.rotation import quaternion_from_rotation, rotation_from_angles

SCHEMA = part_schema("none", {"headturn": "0"}, "c" * 64)


def test_table_holds_what_the_unit_gave(rows):
    table = unit_table(rows, SCHEMA)
    assert table.schema.equals(SCHEMA, check_metadata=True)
    assert not any(field.nullable for field in table.schema)
    angles = np.stack([as_array(table, f"{a}_deg") for a in ("yaw", "pitch", "roll")], axis=1)
    np.testing.assert_array_equal(angles, rows.angles_deg)
    rotation = rotation_from_angles(rows.angles_deg)
    np.testing.assert_array_equal(as_array(table, "rotation").reshape(-1, 3, 3), rotation)
    np.testing.assert_array_equal(as_array(table, "quaternion"), quaternion_from_rotation(rotation))
    np.testing.assert_array_equal(as_array(table, "landmarks"), rows.landmarks)
    exact = as_array(table, "landmarks_exact").astype(float)
    anchored = exact[3] - rows.cameras[0].translation_mm  # back to pose zero: x R is the inverse of R x
    np.testing.assert_allclose(anchored @ rotation[3], rows.anchors, atol=1e-4)
    np.testing.assert_array_equal(np.isnan(exact).any(axis=(0, 2)), np.isnan(rows.anchors).any(axis=1))
    np.testing.assert_array_equal(as_array(table, "landmarks_visible"), rows.visible)
    np.testing.assert_array_equal(as_array(table, "camera")[3].reshape(3, 3), rows.cameras[0].matrix)
    assert table["sample_id"][0].as_py() == "s1/neutral/y-30_p-20_r+0"
    assert table["image_sha256"].to_pylist() == [hashlib.sha256(i).hexdigest() for i in rows.images]
    assert set(table["image_path"].to_pylist()) == {""}
    assert (~as_array(table, "detected")).sum() == 2


def test_schema_metadata_says_how_to_read_it():
    metadata = {key.decode(): value.decode() for key, value in SCHEMA.metadata.items()}
    assert metadata["headturn.schema_version"] == SCHEMA_VERSION
    assert metadata["headturn.landmark_topology"] == "mediapipe-face-mesh-468"
    assert metadata["headturn.configuration_digest"] == "c" * 64
    assert json.loads(metadata["headturn.versions"]) == {"headturn": "0"}
    conventions = json.loads(metadata["headturn.conventions"])
    assert "Rx(-pitch) Ry(yaw) Rz(roll)" in conventions["rotation"]
    assert "w, x, y, z" in conventions["quaternion"]


@pytest.mark.parametrize(
    "change",
    [
        {"detected": np.ones(18, bool)},
        {"detected": np.zeros(18, bool)},
        {"images": [b""]},
        {"landmarks": np.zeros((18, 1404), np.float32)},
        {"visible": np.ones((18, 468), bool)},
        {"passes": [(b"", "")]},
    ],
)
def test_unit_refuses_what_does_not_fit(rows, change):
    with pytest.raises(ValueError, match=r"expected|landmarks must be|without an anchor"):
        replace(rows, **change)


@pytest.mark.parametrize("name", ["a/b", "..", "", "a\n", "C:", "a ", ".hidden"])
def test_unit_refuses_names_that_are_paths(rows, name):
    with pytest.raises(DatasetError, match="choose another name"):
        replace(rows, subject=name)


def test_part_round_trip_and_encoding(rows, tmp_path):
    table = unit_table(rows, SCHEMA)
    info = write_part(table, tmp_path, "train", "u1")
    path = tmp_path / "data" / "train" / "part-u1.parquet"
    assert [p.name for p in path.parent.iterdir()] == ["part-u1.parquet"]
    assert info == check_part(path)
    assert (info.path, info.rows, info.detected) == ("data/train/part-u1.parquet", 18, 16)
    assert (info.subject, info.expression) == ("s1", "neutral")
    assert info.sha256 == hashlib.sha256(path.read_bytes()).hexdigest() and info.bytes == path.stat().st_size
    # Table.equals calls NaN unequal; the digest does not.
    assert content_digest(read_part(path)) == content_digest(table) == info.digest
    assert read_part(path).schema.equals(SCHEMA, check_metadata=True)
    group = pq.ParquetFile(path).metadata.row_group(0)
    columns = {group.column(i).path_in_schema: group.column(i) for i in range(group.num_columns)}
    landmarks = columns["landmarks.list.element"]
    assert "BYTE_STREAM_SPLIT" in landmarks.encodings and not landmarks.has_dictionary_page
    assert {column.compression for column in columns.values()} == {"ZSTD"}
    assert columns["yaw_deg"].statistics.min == -30 and not landmarks.is_stats_set


def test_same_unit_same_bytes(rows, tmp_path):
    one, two = (write_part(unit_table(rows, SCHEMA), tmp_path / name, "train", "u") for name in "ab")
    assert one == two


def test_files_are_written_with_their_hash(rows, tmp_path):
    commit_unit(rows, part_schema("files", {}, ""), tmp_path, "u")
    table = read_part(tmp_path / "data/train/part-u.parquet")
    for path, sha256 in zip(table["image_path"].to_pylist(), table["image_sha256"].to_pylist(), strict=True):
        assert hashlib.sha256((tmp_path / path).read_bytes()).hexdigest() == sha256
    assert (tmp_path / "images/s1/neutral/y-30_p-20_r+0.png").is_file()


def test_digest_ignores_order_cut_encoding_and_embedding(rows, tmp_path):
    table = unit_table(rows, SCHEMA)
    digest = content_digest(table)
    shuffled = table.take(np.random.default_rng(0).permutation(len(table)))
    assert content_digest(shuffled) == digest
    assert content_digest(table.select(table.schema.names[::-1])) == digest
    assert add_digests([content_digest(table.slice(0, 7)), content_digest(table.slice(7))]) == digest
    assert content_digest(unit_table(rows, part_schema("embedded", {}, ""))) == digest
    pq.write_table(table, tmp_path / "other.parquet", compression="none")
    assert content_digest(pq.read_table(tmp_path / "other.parquet")) == digest
    other_nan = table.set_column(
        table.schema.get_field_index("landmarks"),
        table.schema.field("landmarks"),
        pa.FixedSizeListArray.from_arrays(
            pa.array(np.where(np.isnan(rows.landmarks), -np.float32("nan"), rows.landmarks).reshape(-1)),
            type=table.schema.field("landmarks").type,
        ),
    )
    assert content_digest(other_nan) == digest


def test_digest_is_the_documented_one():
    table = pa.table({"b": pa.array([1.5, float("nan")]), "a": ["x", "é"], "c": [True, False]})
    header = hashlib.sha256(b"a:text\nb:f8\nc:u1").digest()
    rows = [
        b"\0\0\0\0\0\0\xf8\x3f" + b"\1" + b"\1\0\0\0x",
        b"\0\0\0\0\0\0\xf8\x7f" + b"\0" + b"\2\0\0\0\xc3\xa9",
    ]
    total = sum(int.from_bytes(hashlib.sha256(header + row).digest(), "big") for row in rows) % 2**256
    assert content_digest(table) == f"{total:064x}"


@pytest.mark.parametrize(
    "column",
    ["yaw_deg", "landmarks", "landmarks_exact", "landmarks_visible", "subject", "detected", "yaw_index"],
)
def test_digest_sees_every_value(rows, column):
    table = unit_table(rows, SCHEMA)
    place = table.schema.get_field_index(column)
    changed = table[column].combine_chunks().take(np.r_[17, 1:18])
    if column in ("subject", "detected"):
        changed = pa.array(["other" if column == "subject" else False, *table[column].to_pylist()[1:]])
    changed = table.set_column(place, table.schema.field(column), changed)
    assert content_digest(changed) != content_digest(table)


def test_write_to_a_place_that_is_not_a_folder(rows, tmp_path):
    (tmp_path / "data").write_text("in the way")
    with pytest.raises(DatasetError, match=r"part-u\.parquet: cannot be written \(.*\); free some"):
        write_part(unit_table(rows, SCHEMA), tmp_path, "train", "u")


FULL_DISK = """
import resource, sys
from pathlib import Path
import pyarrow as pa
from generator.dataset.format.part import write_part
from generator.errors import DatasetError
table = pa.ipc.open_file(sys.argv[1]).read_all()
resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))
try:
    write_part(table, Path(sys.argv[2]), "train", "u")
except DatasetError as error:
    print(error)
"""


@pytest.mark.skipif(os.name != "posix", reason="needs a limit on file sizes")
def test_disk_full_leaves_nothing(rows, tmp_path):
    table = unit_table(rows, SCHEMA)
    with pa.OSFile(str(tmp_path / "t.arrow"), "wb") as file, pa.ipc.new_file(file, table.schema) as writer:
        writer.write_table(table)
    arguments = [sys.executable, "-c", FULL_DISK, str(tmp_path / "t.arrow"), str(tmp_path / "out")]
    done = subprocess.run(
        arguments, capture_output=True, text=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    )
    assert done.returncode == 0, done.stderr
    assert "part-u.parquet: cannot be written (File too large)" in done.stdout
    assert done.stdout.count("\n") == 1
    assert list((tmp_path / "out/data/train").iterdir()) == []


def test_an_interrupted_write_keeps_the_old_part(rows, tmp_path, monkeypatch):
    write_part(unit_table(rows, SCHEMA), tmp_path, "train", "u")
    path = tmp_path / "data/train/part-u.parquet"
    before = path.read_bytes()
    monkeypatch.setattr(os, "replace", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
    with pytest.raises(KeyboardInterrupt):
        write_part(unit_table(rows, SCHEMA).slice(0, 3), tmp_path, "train", "u")
    assert path.read_bytes() == before and [p.name for p in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("damage", ["missing", "empty", "truncated", "flipped", "other table"])
def test_check_part_refuses(rows, tmp_path, damage):
    write_part(unit_table(rows, SCHEMA), tmp_path, "train", "u")
    path = tmp_path / "data/train/part-u.parquet"
    content = bytearray(path.read_bytes())
    if damage == "missing":
        path.unlink()
    elif damage == "other table":
        pq.write_table(pa.table({"x": [1]}), path)
    else:
        content[len(content) // 2] ^= 1
        path.write_bytes({"empty": b"", "truncated": content[:-100], "flipped": content}[damage])
    with pytest.raises(DatasetError, match=r"part-u\.parquet: not a readable part \(.*\); delete") as error:
        check_part(path)
    assert "\n" not in str(error.value)
