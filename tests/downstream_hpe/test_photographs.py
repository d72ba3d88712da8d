# SPDX-License-Identifier: MIT
from __future__ import annotations

import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat

from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.photographs import FORMATS, LeftOut, aflw2000, biwi, biwi_npz, detected_rows
from downstream_hpe.geometry.rotation import angles_from_rotation, rotation_from_angles

YPR = np.array([-35, 12.5, -7])
FACE = np.random.default_rng(0).uniform(-10, 10, size=(468, 3))

# The calibration and one label as the Biwi database has them, from the card of its Hugging Face copy.
RGB_CAL = """\
517.679 0 320
0 517.679 240.5
0 0 1

0 0 0 0

0.999947 0.00432361 0.00929419
-0.00446314 0.999877 0.0150443
-0.009228 -0.015085 0.999844

-24.0198 5.8896 -13.2308

640 480
"""
POSE = """\
0.980639 0.109899 0.162077
-0.11023 0.993882 -0.00697376
-0.161851 -0.011027 0.986754

43.4019 -30.7038 906.864
"""


def picture(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (8, 6), (255, 0, 0)).save(path)


def aflw(folder, name, ypr_deg, **more):
    yaw, pitch, roll = np.deg2rad(ypr_deg)
    savemat(folder / f"{name}.mat", {"Pose_Para": np.array([[pitch, yaw, roll, 1, 2, 3, 0.1]]), **more})
    picture(folder / f"{name}.jpg")


def kinect(folder, pose=POSE, calibration=RGB_CAL):
    picture(folder / "01" / "frame_00003_rgb.png")
    (folder / "01" / "frame_00003_pose.txt").write_text(pose)
    if calibration is not None:
        (folder / "01" / "rgb.cal").write_text(calibration)


def test_aflw2000_order_units_and_filter(tmp_path):
    points = np.random.default_rng(0).uniform(100, 200, size=(3, 68))
    aflw(tmp_path, "image00002", YPR, pt3d_68=points)
    aflw(tmp_path, "image00004", [99.5, 0, 0])
    aflw(tmp_path, "image00005", [0, -99.0, 98.9])
    left_out = LeftOut()
    first, second = aflw2000(tmp_path, left_out)
    np.testing.assert_allclose(angles_from_rotation(first.rotation), YPR, atol=1e-9)
    np.testing.assert_allclose(first.centre, points[:2].mean(axis=1))
    assert second.centre is None
    assert first.bgr.shape == (6, 8, 3)
    assert first.bgr[0, 0, 2] > 250 > first.bgr[0, 0, 0]
    assert left_out.damaged == []
    assert left_out.filtered == {"an angle beyond 99 degrees": 1}


def test_our_export_of_300w_lp_is_read_at_its_root(tmp_path):
    for n, split in enumerate(("train", "test")):
        (tmp_path / split).mkdir()
        aflw(tmp_path / split, "s_neutral_0", YPR + n)
    (tmp_path / "files.txt").write_text("test/s_neutral_0\ntrain/s_neutral_0\n")
    # AFLW2000-3D brings code along, with .mat files that are no labels.
    (tmp_path / "Code").mkdir()
    savemat(tmp_path / "Code" / "Model_Shape.mat", {"w": 1})
    left_out = LeftOut()
    found = {photograph.name: photograph for photograph in aflw2000(tmp_path, left_out)}
    assert list(found) == ["test/s_neutral_0", "train/s_neutral_0"]
    assert left_out.damaged == []
    np.testing.assert_allclose(angles_from_rotation(found["train/s_neutral_0"].rotation), YPR, atol=1e-9)
    aflw(tmp_path, "image1", YPR)
    assert [photograph.name for photograph in aflw2000(tmp_path, left_out)] == ["image1"]


def test_points_that_can_be_none_are_none(tmp_path):
    for n, spoilt in enumerate((np.full((3, 68), 1e300), np.full((3, 68), np.nan), np.zeros((2, 68)))):
        aflw(tmp_path, f"image{n}", YPR, pt3d_68=spoilt)
    found = list(aflw2000(tmp_path, LeftOut()))
    assert [(photograph.points, photograph.centre) for photograph in found] == [(None, None)] * 3


def test_biwi_angles_are_those_of_its_usual_readers(tmp_path):
    kinect(tmp_path / "hpdb")
    (only,) = biwi(tmp_path, LeftOut())
    # HopeNet, FSA-Net, 6DRepNet: the file's matrix, transposed first.
    m = np.array(POSE.split()[:9], dtype=float).reshape(3, 3).T
    roll, pitch = -np.arctan2(m[1, 0], m[0, 0]), np.arctan2(m[2, 1], m[2, 2])
    yaw = -np.arctan2(-m[2, 0], np.hypot(m[2, 1], m[2, 2]))
    np.testing.assert_allclose(angles_from_rotation(only.rotation), np.rad2deg([yaw, pitch, roll]), atol=1e-3)
    # The head is right of the middle and above it, as its place in millimetres says.
    expected = np.array([320, 240.5]) + 517.679 * np.array([27.66, -11.36]) / 892.97
    np.testing.assert_allclose(only.centre, expected, atol=0.1)
    assert only.subject == "01"


def test_biwi_in_the_frame_of_the_colour_camera(tmp_path):
    kinect(tmp_path)
    (label,), (seen,) = biwi(tmp_path, LeftOut()), FORMATS["biwi-colour"](tmp_path, LeftOut())
    turn = np.array(RGB_CAL.split()[13:22], dtype=float).reshape(3, 3)
    np.testing.assert_allclose(seen.rotation, turn @ label.rotation)
    (tmp_path / "01" / "rgb.cal").unlink()
    (plain,) = biwi(tmp_path, LeftOut())
    assert plain.centre is None
    with pytest.raises(DataError, match=r"rgb\.cal: there is no such file"):
        list(FORMATS["biwi-colour"](tmp_path, LeftOut()))


def test_the_generators_biwi_export_is_read_back(tmp_path):
    rotation = rotation_from_angles(YPR)
    lines = "\n".join(" ".join(f"{x:.12f}" for x in row) for row in rotation)
    identity = "700 0 128\n0 700 128\n0 0 1\n\n0 0 0 0\n\n1 0 0\n0 1 0\n0 0 1\n\n0 0 0\n\n256 256\n"
    kinect(tmp_path, f"{lines}\n\n0 0 700\n", identity)
    (only,) = biwi(tmp_path, LeftOut())
    np.testing.assert_allclose(only.rotation, rotation, atol=1e-9)
    np.testing.assert_allclose(only.centre, [128, 128])


def test_biwi_as_npz(tmp_path):
    np.savez(tmp_path / "b.npz", image=np.zeros((2, 4, 4, 3), np.uint8), pose=np.stack([YPR, -YPR]))
    first, second = biwi_npz(tmp_path / "b.npz", LeftOut())
    np.testing.assert_allclose(angles_from_rotation(first.rotation), YPR)
    np.testing.assert_allclose(angles_from_rotation(second.rotation), -YPR)
    radians = np.deg2rad(np.tile(YPR, (200, 1)))
    np.savez(tmp_path / "r.npz", image=np.zeros((200, 4, 4, 3), np.uint8), pose=radians)
    with pytest.raises(DataError, match="these look like radians"):
        list(biwi_npz(tmp_path / "r.npz", LeftOut()))


def test_the_labelled_face_among_several_and_misses(tmp_path):
    for n, x in enumerate((100, 300, 700)):
        aflw(tmp_path, f"image{n}", YPR + n, pt3d_68=np.full((3, 68), float(x)))
    # Two faces, the more prominent one at 300; none at 700.
    two = np.stack([FACE + np.array(at) for at in ((300, 300, 0), (102, 100, 0))])
    asked = []

    def faces(bgr, limit):
        asked.append(limit)
        return two[:limit]

    rows, missed_deg, own = detected_rows(aflw2000(tmp_path, LeftOut()), faces)
    assert min(asked) > 1
    assert (len(rows), rows.undetected) == (2, 1)
    np.testing.assert_allclose(rows.landmarks[:, :, 0].mean(axis=1), two[::-1, :, 0].mean(axis=1), atol=1e-4)
    np.testing.assert_allclose(missed_deg, [YPR + 2])
    np.testing.assert_allclose(own[0, :, :2], 100)
    with pytest.raises(DataError, match="no face found in 3 photographs"):
        detected_rows(aflw2000(tmp_path, LeftOut()), lambda bgr, limit: two[:0])


def test_without_a_labelled_place_the_most_prominent_face_is_taken(tmp_path):
    images = np.stack([np.zeros((4, 4, 3)), np.ones((4, 4, 3))]).astype(np.uint8)
    np.savez(tmp_path / "b.npz", image=images, pose=np.stack([YPR, -YPR]))
    photographs = biwi_npz(tmp_path / "b.npz", LeftOut())
    rows, missed_deg, _ = detected_rows(
        photographs, lambda bgr, limit: FACE[None][: limit if bgr.any() else 0]
    )
    np.testing.assert_allclose(rows.ypr_deg, [-YPR])
    np.testing.assert_allclose(missed_deg, [YPR])


def test_damaged_and_foreign_files_say_so(tmp_path):
    left_out = LeftOut()
    for load in (aflw2000, biwi):
        with pytest.raises(DataError, match=r"no \*.* in it; expected one beside every \*"):
            list(load(tmp_path, left_out))
        with pytest.raises(DataError, match="not a folder"):
            list(load(tmp_path / "nowhere", left_out))
    np.savez(tmp_path / "x.npz", image=np.array([{"pickled": 1}], dtype=object), pose=np.zeros((1, 3)))
    whole = (tmp_path / "x.npz").read_bytes()
    for content in (whole, whole[:100], b"no", b""):
        (tmp_path / "x.npz").write_bytes(content)
        with pytest.raises(DataError, match=r"expected an \.npz"):
            list(biwi_npz(tmp_path / "x.npz", left_out))


def test_what_is_damaged_is_left_out_with_a_line_each(tmp_path):
    aflw(tmp_path, "a", YPR)
    whole = (tmp_path / "a.mat").read_bytes()
    packed = tmp_path / "packed.mat"
    savemat(packed, {"Pose_Para": np.zeros((1, 7)), "pt3d_68": FACE[:68].T}, do_compression=True)
    spoiled = bytearray(packed.read_bytes())
    spoiled[150] ^= 255
    packed.unlink()
    labels = {"b": b"no", "c": b"", "d": whole[:100], "e": whole[:200], "f": bytes(spoiled)}
    for name, content in labels.items():
        (tmp_path / f"{name}.mat").write_bytes(content)
    savemat(tmp_path / "g.mat", {"other": 1})
    savemat(tmp_path / "h.mat", {"Pose_Para": np.full((1, 7), np.nan)})
    picture(tmp_path / "i.jpg")
    aflw(tmp_path, "j", YPR)
    (tmp_path / "j.jpg").write_bytes(b"no")
    aflw(tmp_path, "k", YPR)
    (tmp_path / "k.jpg").unlink()
    aflw(tmp_path, "l", -YPR)
    left_out = LeftOut()
    assert [p.name for p in aflw2000(tmp_path, left_out)] == ["a", "l"]
    says = [line.removeprefix(f"{tmp_path}/") for line in left_out.damaged]
    assert says == [
        *(f"{name}.mat: no Pose_Para can be read from it" for name in "bcdefg"),
        "h.mat: Pose_Para is [nan, nan, nan, nan, nan, nan, nan], expected pitch, yaw, roll, ...",
        "i.mat: there is no such label beside i.jpg",
        "j.jpg: not a readable picture; it holds text",
        "k.jpg: there is no such picture",
    ]


def test_damaged_frames_of_biwi_are_left_out_with_a_line_each(tmp_path):
    kinect(tmp_path)
    frames = tmp_path / "01"
    for n, pose in ((4, "1 2 3\n4 5 6\n7 8 9\n\n0 0 700\n"), (5, "1 2 3\n"), (6, None), (7, POSE)):
        picture(frames / f"frame_0000{n}_rgb.png")
        if pose is not None:
            (frames / f"frame_0000{n}_pose.txt").write_text(pose)
    (frames / "frame_00007_rgb.png").write_bytes(b"no")
    left_out = LeftOut()
    assert [p.name for p in biwi(tmp_path, left_out)] == ["01/frame_00003_rgb"]
    assert [line.removeprefix(f"{frames}/") for line in left_out.damaged] == [
        "frame_00004_pose.txt: its first three lines are not a rotation",
        "frame_00005_pose.txt: expected 12 numbers, a rotation and a place",
        "frame_00006_pose.txt: there is no such file",
        "frame_00007_rgb.png: not a readable picture; it holds text",
    ]
    # A calibration that cannot be read would spoil them all.
    (frames / "rgb.cal").write_text("517 0")
    with pytest.raises(DataError, match=r"rgb\.cal: expected 25 numbers"):
        list(biwi(tmp_path, left_out))
