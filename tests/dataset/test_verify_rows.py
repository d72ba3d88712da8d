# SPDX-License-Identifier: GPL-3.0-or-later
"""What verify finds in rows, though the manifest was made to agree."""

from __future__ import annotations

import re

import pytest
from damage import PART, failures, rewrite

from generator.dataset.format.part import read_part
from generator.dataset.proof.verify import verify_dataset
from generator.geometry.camera import Camera
from generator.plan.poses import grid_plan


def test_a_tampered_label(dataset):
    yaw = read_part(dataset / PART)["yaw_deg"].to_pylist()
    rewrite(dataset, {"yaw_deg": [0.0, *yaw[1:]]}, honest=False)
    problems = failures(verify_dataset(dataset))
    assert set(problems) == {"part hashes", "every row once", "identity", "rotation", "digest"}
    assert "y-30_p-20_r+0: rotation does not agree with the angles" in problems["rotation"]
    assert f"{PART} holds other values than the manifest says" in problems["digest"]


@pytest.mark.parametrize(
    ("name", "value", "check", "message"),
    [
        ("yaw_deg", 0.0, "every row once", "y-30_p-20_r\\+0 is missing"),
        ("yaw_deg", 12.0, "every row once", "y-30_p-20_r\\+0 is not in heads.parquet x poses.csv"),
        ("yaw_deg", float("nan"), "every row once", "is not in heads.parquet"),
        ("subject", "s3", "every row once", "is not in heads.parquet"),
        ("sample_id", "x/y/z", "identity", "x/y/z should be called s1/neutral/y-30_p-20_r\\+0"),
        ("split", "test", "identity", "split 'test' in data/train"),
        ("head_license", "MIT", "identity", "licence differs"),
        ("redistributable", False, "identity", "licence differs"),
        ("yaw_index", 1, "identity", "place in the grid differs"),
        ("rotation", [1.0, 0, 0, 0, 1, 0, 0, 0, 1], "rotation", "rotation does not agree"),
        ("quaternion", [1.0, 0, 0, 0], "rotation", "quaternion does not agree"),
        ("camera", [1.0] * 9, "camera", "camera is not what the configuration plans"),
        ("translation_mm", [0.0, 0, 701], "camera", "translation_mm is not what"),
        ("height", 65, "camera", "not that of the camera's image"),
        ("detected", False, "landmarks", "not detected, but a landmark is not NaN"),
        ("landmarks", [float("nan")] + [0.0] * 1403, "landmarks", "detected, but a landmark is not finite"),
        ("projection", "orthographic", "camera", "projection is not what"),
        ("landmarks_exact", [700.0] * 1404, "exact landmarks", r"not R_C X \+ t"),
        ("landmarks_visible", [True] * 468, "exact landmarks", "without an anchor is visible"),
        ("image_sha256", "0" * 64, "images", "SHA-256 differs"),
        ("image_path", "images/s1/neutral/y-30_p-20_r+10.png", "images", "not where its image belongs"),
        ("image_path", "../../secret.png", "images", "not where its image belongs"),
    ],
)
def test_wrong_values_are_found_even_if_the_manifest_was_made_to_agree(dataset, name, value, check, message):
    values = read_part(dataset / PART)[name].to_pylist()
    rewrite(dataset, {name: [value, *values[1:]]}, honest=True)
    problems = failures(verify_dataset(dataset))
    assert "part hashes" not in problems and "digest" not in problems
    assert re.search(message, problems[check]), problems


def test_a_matrix_off_by_more_than_1e_12(dataset):
    values = read_part(dataset / PART)["rotation"].to_pylist()
    values[0][4] += 2e-12
    rewrite(dataset, {"rotation": values}, honest=True)
    assert set(failures(verify_dataset(dataset))) == {"rotation"}


@pytest.mark.parametrize(("pitch", "either"), [(180, True), (170, False)])
def test_a_turn_back_is_another_rotation_unless_it_is_half_a_turn(build, tmp_path, pitch, either):
    build(tmp_path / "d", "none", plan=grid_plan((0, 0, 1), (pitch, pitch, 1), (0, 0, 1)))
    rows = read_part(tmp_path / "d" / PART)["quaternion"].to_pylist()
    values = [[w, -x, -y, -z] for w, x, y, z in rows]
    rewrite(tmp_path / "d", {"quaternion": values}, honest=True)
    assert ("rotation" in failures(verify_dataset(tmp_path / "d"))) != either
    rewrite(tmp_path / "d", {"quaternion": [[-value for value in row] for row in rows]}, honest=True)
    assert "quaternion does not agree" in failures(verify_dataset(tmp_path / "d"))["rotation"], (
        "w is not below 0"
    )


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("image_path", "images/s1/neutral/y-30_p-20_r+0.png", "although images = none"),
        ("image_sha256", "0" * 63, "the image is not the one that was rendered"),
        ("image_sha256", "0" * 64, ""),
    ],
)
def test_what_rows_say_of_images_that_were_not_kept(build, tmp_path, column, value, said):
    build(tmp_path / "d", "none")
    values = read_part(tmp_path / "d" / PART)[column].to_pylist()
    rewrite(tmp_path / "d", {column: [value, *values[1:]]}, honest=True)
    found = failures(verify_dataset(tmp_path / "d"))
    assert said in found["images"] if said else "images" not in found


@pytest.mark.parametrize("value", [None, {"bytes": None, "path": "x.png"}])
def test_nulls_in_the_only_nullable_column(build, tmp_path, value):
    build(tmp_path / "d", "embedded")
    images = read_part(tmp_path / "d" / PART)["image"].to_pylist()
    rewrite(tmp_path / "d", {"image": [value, *images[1:]]}, honest=True)
    assert failures(verify_dataset(tmp_path / "d"))["no nulls"] == f"{PART}: nulls in image"


def test_the_rigid_fit_must_close(dataset):
    """Rotation, quaternion, angles and grid agree; only the exact landmarks know better."""
    report = verify_dataset(dataset)
    assert 0 < report.closure_deg < 1e-5
    exact = read_part(dataset / PART)["landmarks_exact"].to_pylist()
    exact[0][2] += 1e-3
    rewrite(dataset, {"landmarks_exact": exact}, honest=True)
    assert "y-30_p-20_r+0: landmarks_exact is not" in failures(verify_dataset(dataset))["exact landmarks"]


def test_what_is_outside_of_the_image_cannot_be_visible(build, tmp_path):
    """The fixture's visibility only asks which side of the face looks to the camera."""
    build(tmp_path / "d", camera=Camera.square(64, 300.0, 700.0))
    problems = failures(verify_dataset(tmp_path / "d"))
    assert set(problems) == {"exact landmarks"}
    assert "y-30_p-20_r+0: a landmark outside the image is visible" in problems["exact landmarks"]
