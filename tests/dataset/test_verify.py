# SPDX-License-Identifier: GPL-3.0-or-later
"""What verify finds of a dataset as a whole: its parts, its files, its tables."""

from __future__ import annotations

import json
import shutil
import threading
import time
from dataclasses import replace

import numpy as np
import psutil
import pyarrow.parquet as pq
import pytest
from damage import PART, failures, rewrite

from generator.dataset.format.anchors_table import read_anchors, write_anchors
from generator.dataset.format.columns import SCHEMA_VERSION
from generator.dataset.format.heads_table import read_heads, write_heads
from generator.dataset.format.manifest import read_manifest, write_manifest
from generator.dataset.format.part import check_part, read_part
from generator.dataset.proof.verify import verify_dataset
from generator.errors import DatasetError
from generator.geometry.camera import Camera
from generator.plan.poses import sobol_plan


@pytest.mark.parametrize("images", ["none", "files", "embedded"])
def test_a_good_dataset(build, tmp_path, images):
    build(tmp_path / "d", images)
    steps = []
    report = verify_dataset(tmp_path / "d", progress=lambda done, total: steps.append((done, total)))
    assert report.ok, report.text()
    assert steps == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert (report.heads, report.poses, report.rows, report.detected_rows) == (2, 18, 36, 32)
    assert report.rate_by_subject == {"s1": 16 / 18, "s2": 16 / 18}
    worst = report.worst_cells[0]
    assert (worst.yaw_deg, worst.pitch_deg, worst.rows, worst.rate) == (30, 20, 4, 0)
    assert report.worst_cells[1].rate == 1
    json.dumps(report.as_dict(), allow_nan=False)
    assert "yaw +30, pitch +20: 0% of 4" in report.text()


@pytest.mark.slow
def test_several_processes_find_the_same(build, tmp_path):
    root = tmp_path / "d"
    build(root, "files")
    assert verify_dataset(root, workers=2).as_dict() == verify_dataset(root, workers=1).as_dict()
    rewrite(root, {"yaw_deg": [1.0] * 10}, honest=True)
    (image,) = list((root / "images/s2").rglob("*.png"))[:1]
    image.write_bytes(b"")
    alone, together = verify_dataset(root, workers=1), verify_dataset(root, workers=2)
    assert not alone.ok
    assert together.as_dict() == alone.as_dict()


def test_a_killed_process_is_one_line(build, tmp_path):
    build(tmp_path / "d", "none")

    def kill_the_first() -> None:
        for _ in range(1000):
            for child in psutil.Process().children():
                if any("generator.pool" in word for word in child.cmdline()):
                    child.kill()
                    return
            time.sleep(0.01)

    killer = threading.Thread(target=kill_the_first)
    killer.start()
    with pytest.raises(DatasetError, match=r"was killed.*--workers 1"):
        verify_dataset(tmp_path / "d", workers=2)
    killer.join()


def test_quick_reads_no_rows_and_says_so(build, tmp_path):
    root = tmp_path / "d"
    build(root, "files")
    report = verify_dataset(root, quick=True)
    assert report.ok, report.text()
    assert (report.rows, report.heads * report.poses, report.detected_rows) == (36, 36, 32)
    assert "without --quick every byte is read" in report.text()
    assert "closure" not in report.text()
    with (root / PART).open("r+b") as file:  # the same size, other bytes: only reading finds it
        file.seek(100)
        file.write(b"\xff" * 8)
    assert verify_dataset(root, quick=True).ok
    assert not verify_dataset(root).ok
    with (root / PART).open("ab") as file:
        file.write(b"more")
    assert set(failures(verify_dataset(root, quick=True))) == {"part sizes"}
    (root / PART).unlink()
    assert set(failures(verify_dataset(root, quick=True))) == {"part files", "rows"}


def test_poses_off_the_grid(build, tmp_path):
    build(tmp_path / "d", "none", plan=sobol_plan(40, 1))
    report = verify_dataset(tmp_path / "d")
    assert report.ok, report.text()
    assert {cell.yaw_deg % 10 for cell in report.cells} == {0}
    assert sum(cell.rows for cell in report.cells) == 80


def test_images_that_are_not_square(build, tmp_path):
    camera = Camera(96, 64, 85.0, 700.0)
    build(tmp_path / "d", camera=camera, render={"aspect": 1.5})
    report = verify_dataset(tmp_path / "d")
    assert report.ok, report.text()


def test_a_deleted_part(dataset):
    (dataset / PART).unlink()
    problems = failures(verify_dataset(dataset))
    assert problems["part files"] == f"{PART} is missing"
    assert problems["every row once"] == (
        "s1/neutral/y-30_p-20_r+0 is missing; s1/neutral/y-30_p-20_r+10 is missing; "
        "s1/neutral/y-30_p+0_r+0 is missing and 7 more"
    )
    assert set(problems) == {"part files", "every row once", "digest"}


def test_failed_units_are_named_beside_the_missing_rows(dataset):
    manifest = read_manifest(dataset)
    (dataset / PART).unlink()
    parts = tuple(part for part in manifest.parts if part.path != PART)
    write_manifest(replace(manifest, parts=parts, failures=1), dataset)
    problems = failures(verify_dataset(dataset))
    assert set(problems) == {"every row once"}
    assert problems["every row once"].startswith("1 units failed, see failures.jsonl; s1/neutral/")


@pytest.mark.parametrize("place", np.linspace(0, 0.999, 24).tolist())
def test_a_flipped_bit_anywhere(dataset, place):
    content = bytearray((dataset / PART).read_bytes())
    content[int(place * len(content))] ^= 4
    (dataset / PART).write_bytes(content)
    problems = failures(verify_dataset(dataset))
    assert f"{PART} was changed or damaged after the build" in problems["part hashes"]


@pytest.mark.parametrize("keep", [0, 3, 4000, -9])
def test_a_truncated_part(dataset, keep):
    (dataset / PART).write_bytes((dataset / PART).read_bytes()[:keep])
    report = verify_dataset(dataset)
    assert (report.rows, report.detected_rows) == (26, 22)
    problems = failures(report)
    assert "SHA-256 differs" in problems["part hashes"] and "not a readable part" in problems["part hashes"]
    assert "and 7 more" in problems["every row once"]


def test_doubled_rows(dataset):
    shutil.copy(dataset / PART, dataset / "data/train/part-copy.parquet")
    assert failures(verify_dataset(dataset)) == {
        "part files": "data/train/part-copy.parquet is not listed in the manifest"
    }
    manifest = read_manifest(dataset)
    copy = check_part(dataset / "data/train/part-copy.parquet")
    write_manifest(replace(manifest, parts=(*manifest.parts, copy)), dataset)
    problems = failures(verify_dataset(dataset))
    assert set(problems) == {"every row once"}
    assert "y-30_p-20_r+0 is there more than once" in problems["every row once"]


@pytest.mark.parametrize(("column", "value"), [("subject", "s2"), ("expression", "smile")])
def test_a_part_of_another_head_than_the_manifest_says(dataset, column, value):
    manifest = read_manifest(dataset)
    parts = tuple(replace(p, **{column: value}) if p.path == PART else p for p in manifest.parts)
    write_manifest(replace(manifest, parts=parts), dataset)
    quick = failures(verify_dataset(dataset, quick=True))
    assert quick == {"part files": f"{PART} is not of {value}, as the manifest says"}
    said = "s2/neutral" if column == "subject" else "s1/smile"
    assert failures(verify_dataset(dataset)) == {
        "part hashes": f"{PART} is not of {said}, as the manifest says"
    }


@pytest.mark.parametrize("change", [{"rows": 9}, {"detected": 7}])
def test_a_part_with_other_counts_than_the_manifest_says(dataset, change):
    manifest = read_manifest(dataset)
    parts = tuple(replace(p, **change) if p.path == PART else p for p in manifest.parts)
    write_manifest(replace(manifest, parts=parts), dataset)
    found = failures(verify_dataset(dataset))
    assert f"{PART} has 10 rows, the manifest says {change.get('rows', 10)}" in found["part hashes"]


def test_leftovers_of_a_killed_build(dataset):
    (dataset / "data/train/.part-s9.tmp").write_bytes(b"PAR1")
    assert failures(verify_dataset(dataset)) == {
        "part files": "data/train/.part-s9.tmp is not listed in the manifest"
    }


def test_images_removed_or_replaced(dataset):
    pictures = sorted((dataset / "images/s1/neutral").iterdir())
    pictures[0].unlink()
    pictures[1].write_bytes(pictures[2].read_bytes())
    problems = failures(verify_dataset(dataset))
    assert set(problems) == {"images"}
    assert f"{pictures[0].name}: No such file" in problems["images"]
    assert f"{pictures[1].name}: the image is not the one that was rendered" in problems["images"]


def test_an_embedded_image_replaced(build, tmp_path):
    build(tmp_path / "d", "embedded")
    images = read_part(tmp_path / "d" / PART)["image"].to_pylist()
    rewrite(tmp_path / "d", {"image": [images[1], *images[1:]]}, honest=True)
    problems = failures(verify_dataset(tmp_path / "d"))
    assert set(problems) == {"images"} and "y-30_p-20_r+0: the image is not" in problems["images"]


def test_another_schema(dataset):
    table = read_part(dataset / PART)
    pq.write_table(table.drop_columns(["quaternion"]), dataset / PART)
    problems = failures(verify_dataset(dataset))
    assert problems["schema"] == f"{PART}: columns differ from schema {SCHEMA_VERSION}: quaternion"
    metadata = {**table.schema.metadata, b"headturn.configuration_digest": b"0"}
    pq.write_table(table.replace_schema_metadata(metadata), dataset / PART)
    assert "headturn.configuration_digest is '0', expected" in failures(verify_dataset(dataset))["schema"]


@pytest.mark.parametrize(
    ("file", "check", "message"),
    [
        ("manifest.json", "manifest", "not a Headturn dataset, or its build did not finish"),
        ("heads.parquet", "heads and poses", "heads.parquet: cannot be read"),
        ("poses.csv", "heads and poses", "poses.csv: not the poses of an earlier build"),
    ],
)
def test_a_missing_side_file(dataset, file, check, message):
    (dataset / file).unlink()
    report = verify_dataset(dataset)
    problems = failures(report)
    assert message in problems[check] and not report.ok
    assert problems["images"] == "not checked, because of the problems above"


def test_a_missing_head_or_pose(dataset):
    write_heads(read_heads(dataset)[:1], dataset)
    write_manifest(read_manifest(dataset), dataset)
    problems = failures(verify_dataset(dataset))
    assert problems["heads and poses"] == "heads.parquet has 1 heads, the manifest says 2"
    assert "s2/neutral/y-30_p-20_r+0 is not in heads.parquet" in problems["every row once"]


def test_a_changed_side_table(dataset):
    first, second = read_heads(dataset)
    write_heads([first, replace(second, attribution="Somebody else")], dataset)
    assert failures(verify_dataset(dataset)) == {
        "heads and poses": "heads.parquet was changed after the build (SHA-256 differs)"
    }


def test_not_a_dataset(tmp_path):
    report = verify_dataset(tmp_path / "nowhere")
    assert not report.ok and "no such folder" in report.text()
    report = verify_dataset(tmp_path)
    assert not report.ok and "run `headturn build` again" in report.text()


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        ("moved", "landmarks_exact is not R_C X + t of its anchors"),
        ("lost", "s1/neutral: 2 points without an anchor, heads.parquet says 1"),
        ("weights", "s1/neutral: weights do not add up to 1"),
        ("head", "s1/neutral is missing"),
        ("stranger", "s9/neutral is not in heads.parquet"),
    ],
)
def test_wrong_anchors(dataset, damage, message):
    anchors = read_anchors(dataset)
    first = anchors.pop(("s1", "neutral"))
    points, triangles, weights = first.points.copy(), first.triangles.copy(), first.weights.copy()
    if damage == "moved":
        points[0, 0] += 1e-3
    elif damage == "lost":
        points[0], triangles[0] = np.nan, -1
    elif damage == "weights":
        weights[0] = 0.5
    subject = "s9" if damage == "stranger" else "s1"
    if damage != "head":
        anchors[subject, "neutral"] = replace(
            first, subject=subject, points=points, triangles=triangles, weights=weights
        )
    write_anchors(list(anchors.values()), dataset)
    write_manifest(read_manifest(dataset), dataset)
    problems = failures(verify_dataset(dataset))
    assert message in problems.get("anchors", "") + problems.get("exact landmarks", "")


def test_no_anchors_table(dataset):
    (dataset / "anchors.parquet").unlink()
    assert "anchors.parquet: cannot be read" in failures(verify_dataset(dataset))["heads and poses"]


def test_of_rows_that_cannot_be_read_nothing_is_said(dataset):
    for part in read_manifest(dataset).parts:
        content = bytearray((dataset / part.path).read_bytes())
        content[len(content) // 2] ^= 1
        (dataset / part.path).write_bytes(content)
    said = verify_dataset(dataset).text()
    assert "not checked, because of the problems above: no nulls, identity, rotation" in said, said
    assert "ok    rotation" not in said and "digest 0000" not in said
