# SPDX-License-Identifier: MIT
from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat

from downstream_hpe.errors import DataError
from downstream_hpe.photographs import aflw2000, biwi, biwi_npz, detected_rows
from downstream_hpe.rotation import angles_from_rotation, rotation_from_angles

YPR = np.array([-35, 12.5, -7])


def picture(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (8, 6), (255, 0, 0)).save(path)


def test_aflw2000_order_units_and_filter(tmp_path):
    yaw, pitch, roll = np.deg2rad(YPR)
    for name, pose in (("image00002", [pitch, yaw, roll]), ("image00004", [0, np.deg2rad(99.5), 0])):
        savemat(tmp_path / f"{name}.mat", {"Pose_Para": np.array([[*pose, 1, 2, 3, 0.1]])})
        picture(tmp_path / f"{name}.jpg")
    (only,) = aflw2000(tmp_path)
    np.testing.assert_allclose(angles_from_rotation(only.rotation), YPR, atol=1e-9)
    assert only.bgr.shape == (6, 8, 3)
    assert only.bgr[0, 0, 2] > 250 > only.bgr[0, 0, 0]


def test_biwi_reading_of_fsa_net(tmp_path):
    matrix = rotation_from_angles(YPR).T
    text = "\n".join(" ".join(f"{x:.6f}" for x in row) for row in matrix) + "\n\n10.0 20.0 900.0\n"
    picture(tmp_path / "01" / "frame_00003_rgb.png")
    (tmp_path / "01" / "frame_00003_pose.txt").write_text(text)
    (only,) = biwi(tmp_path)
    # docs/conventions.md, BIWI file matrix, FSA-Net reading.
    roll = -np.arctan2(matrix[1, 0], matrix[0, 0])
    yaw = -np.arctan2(-matrix[2, 0], np.hypot(matrix[2, 1], matrix[2, 2]))
    pitch = np.arctan2(matrix[2, 1], matrix[2, 2])
    np.testing.assert_allclose(np.rad2deg([yaw, pitch, roll]), YPR, atol=1e-4)
    np.testing.assert_allclose(angles_from_rotation(only.rotation), YPR, atol=1e-4)
    assert only.subject == "01"


def test_biwi_as_npz(tmp_path):
    np.savez(tmp_path / "b.npz", image=np.zeros((2, 4, 4, 3), np.uint8), pose=np.stack([YPR, -YPR]))
    first, second = biwi_npz(tmp_path / "b.npz")
    np.testing.assert_allclose(angles_from_rotation(first.rotation), YPR)
    np.testing.assert_allclose(angles_from_rotation(second.rotation), -YPR)


def test_rows_of_those_with_a_face(tmp_path):
    np.savez(
        tmp_path / "b.npz",
        image=np.stack([np.zeros((4, 4, 3)), np.ones((4, 4, 3))]),
        pose=np.stack([YPR, -YPR]),
    )
    rows = detected_rows(biwi_npz(tmp_path / "b.npz"), lambda bgr: np.ones((468, 3)) if bgr.any() else None)
    assert (len(rows), rows.undetected) == (1, 1)
    np.testing.assert_allclose(rows.ypr_deg, [-YPR])
    with pytest.raises(DataError, match="no face found in 2 photographs"):
        detected_rows(biwi_npz(tmp_path / "b.npz"), lambda bgr: None)


def test_damaged_and_foreign_files_say_so(tmp_path):
    with pytest.raises(DataError, match=r"no \*\.mat in it"):
        list(aflw2000(tmp_path))
    (tmp_path / "a.mat").write_bytes(b"no")
    with pytest.raises(DataError, match="no Pose_Para"):
        list(aflw2000(tmp_path))
    (tmp_path / "01").mkdir()
    (tmp_path / "01" / "frame_00001_pose.txt").write_text("1 2 3\n4 5 6\n7 8 9\n")
    with pytest.raises(DataError, match="not a rotation"):
        list(biwi(tmp_path))
    np.savez(tmp_path / "x.npz", image=np.array([{"pickled": 1}], dtype=object), pose=np.zeros((1, 3)))
    with pytest.raises(DataError, match=r"expected an \.npz"):
        list(biwi_npz(tmp_path / "x.npz"))
