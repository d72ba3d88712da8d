# SPDX-License-Identifier: MIT
"""Pictures and videos through predict, with a stand-in for detector and model; the smoothing filter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from clips import SHAPE, Spots, at, bars
from PIL import Image

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.geometry.metrics import geodesic_errors
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.prediction.inputs import Source, find_sources
from downstream_hpe.prediction.predictions import Options, predictions
from downstream_hpe.prediction.smoothing import OneEuroFilter
from downstream_hpe.prediction.tracks import FaceTracks


def test_smoothing_calms_a_still_head_and_follows_a_turn():
    rng = np.random.default_rng(0)
    true = np.zeros((120, 3))
    true[60:80, 0] = np.linspace(0, 40, 20)
    true[80:, 0] = 40
    exact = rotation_from_angles(true)
    noisy = rotation_from_angles(true + rng.normal(scale=1.0, size=true.shape))
    filtered = OneEuroFilter()
    smooth = np.stack([filtered(rotation, n / 30) for n, rotation in enumerate(noisy)])
    np.testing.assert_allclose(smooth @ smooth.transpose(0, 2, 1), np.eye(3)[None].repeat(120, 0), atol=1e-9)
    still = slice(20, 60)
    assert geodesic_errors(smooth, exact)[still].mean() < 0.7 * geodesic_errors(noisy, exact)[still].mean()
    assert geodesic_errors(smooth, exact)[60:90].max() < 10
    with pytest.raises(ValueError, match="times must rise"):
        filtered(noisy[0], 0.0)


def write(path, frames):
    pytest.importorskip("av")
    from downstream_hpe.prediction.video_file import VideoWriter

    with VideoWriter(path) as writer:
        for n, image in enumerate(frames):
            writer.add(image, n / 25)
    return path


def test_every_frame_has_a_record_and_faces_keep_their_index(tmp_path):
    # One stays, one comes from the right and passes below where the detector names it first.
    frames = [bars(n * 2, 50 - n) if n != 5 else bars() for n in range(12)]
    clip = write(tmp_path / "clip.mp4", frames)
    options = Options(faces=2, smooth=True)
    every = find_sources([str(clip)], tmp_path / "drawn")
    records = list(predictions(every, Spots(), options))
    assert [r["frame"] for r in records if not r["found"]] == [5]
    assert [r["frame"] for r in records] == [f for f in range(12) for _ in range(1 if f == 5 else 2)]
    for face, start, step in ((0, 0, 2), (1, 50, -1)):
        mine = [r for r in records if r["face"] == face]
        assert len(mine) == 11
        expected = [start + step * n + SHAPE[:, 0].min() + 5 for n in range(12) if n != 5]
        np.testing.assert_allclose([r["box_x"] for r in mine], expected, atol=2.01)
    assert records[3]["time_s"] == pytest.approx(1 / 25)
    assert records[0]["confidence"] == 0.9
    drawn = list(predictions(find_sources([str(tmp_path / "drawn")]), Spots(), Options()))
    assert len(drawn) == 12
    assert {r["frame"] for r in predictions(every, Spots(), Options(frames=4))} == {0, 1, 2, 3}


def test_a_face_seen_again_later_is_another_one_and_each_has_its_filter():
    tracks = FaceTracks(smooth=True)
    left, right = at(10), at(50)
    assert tracks.indices(np.stack([left, right]), 0.0) == [0, 1]
    assert tracks.indices(np.stack([right, left]), 0.1) == [1, 0]
    assert tracks.indices(right[None], 0.2) == [1]
    assert tracks.indices(np.stack([left, right]), 0.3) == [0, 1]
    assert tracks.indices(np.empty((0, 468, 3)), 2.0) == []
    assert tracks.indices(left[None], 2.1) == [2]
    turn = rotation_from_angles(np.array([20.0, 0, 0]))
    tracks.steady(2, np.eye(3), 2.1)
    assert geodesic_errors(tracks.steady(2, turn, 2.2), turn) > 1
    assert geodesic_errors(tracks.steady(3, turn, 2.2), turn) < 1e-6


def test_a_video_cut_off_keeps_what_was_read(tmp_path):
    cv2 = pytest.importorskip("cv2")
    # Motion JPEG in AVI, as cameras write it: readable up to where it ends.
    writer = cv2.VideoWriter(str(tmp_path / "w.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 64))
    for n in range(60):
        writer.write(bars(n % 50))
    writer.release()
    whole = (tmp_path / "w.avi").read_bytes()
    (tmp_path / "cut.avi").write_bytes(whole[: len(whole) // 2])
    (every,) = find_sources([str(tmp_path / "cut.avi")])
    for limit, expected in ((10, 0), (100, 1)):
        notes = []
        list(predictions([every], Spots(), Options(frames=limit), notes.append))
        assert len(notes) == expected
    (tmp_path / "none.mp4").write_bytes(b"no video")
    (tmp_path / "head.mp4").write_bytes(write(tmp_path / "v.mp4", [bars(3)] * 9).read_bytes()[:200])
    notes = []
    every = find_sources([str(tmp_path / name) for name in ("cut.avi", "none.mp4", "head.mp4", "w.avi")])
    records = list(predictions(every, Spots(), Options(), notes.append))
    counts = [sum(r["input"].endswith(name) for r in records) for name in ("cut.avi", "w.avi")]
    assert 20 < counts[0] < 60
    assert counts[1] == 60
    assert [note.split("/")[-1].split(":")[0] for note in notes] == ["cut.avi", "none.mp4", "head.mp4"]
    assert notes[0].endswith(f"ended after {(counts[0] - 1) / 25:.2f} of 2.40 s; what there was is kept")
    assert "cannot be opened as video" in notes[1]


def test_no_webcam_is_one_line():
    pytest.importorskip("cv2")
    if Path("/dev/video63").exists():
        pytest.skip("there is a webcam 63")
    notes = []
    assert not list(predictions([Source(63)], Spots(), Options(), notes.append))
    (note,) = notes
    assert note.startswith("webcam:63: there is no such webcam")


def test_folders_with_other_files_and_the_same_names(tmp_path):
    for name in ("a.jpg", "a.png", "b/a.jpg", "b/c/x.PNG", ".cache/y.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        Image.fromarray(bars(20)).save(tmp_path / name)
    (tmp_path / "b" / "notes.txt").write_text("no picture")
    (tmp_path / "b" / "broken.png").write_bytes(b"\x89PNG no")
    drawn = tmp_path / "drawn"
    for _ in range(2):  # the second time, drawn copies lie below the input
        notes = []
        every = find_sources([str(tmp_path)], drawn, notes.append)
        records = list(predictions(every, Spots(), Options(), notes.append))
        assert [Path(r["input"]).name for r in records] == ["a.jpg", "a.png", "a.jpg", "x.PNG"]
        copies = sorted(str(f.relative_to(drawn)) for f in drawn.rglob("*.*"))
        assert copies == ["a-2.png", "a.png", "b/a.png", "b/c/x.png"]
        assert len(notes) == 2
        assert "1 files that are no picture or video skipped (b/notes.txt)" in notes[0]
        assert notes[1].endswith("broken.png: not a readable picture")


def test_inputs_that_are_none(tmp_path):
    assert find_sources(["webcam:2"])[0].path == 2
    with pytest.raises(UsageError, match="expected a number"):
        find_sources(["webcam:front"])
    with pytest.raises(UsageError, match="no picture or video in it"):
        find_sources([str(tmp_path)])
    Image.fromarray(bars(3)).save(tmp_path / "a.png")
    with pytest.raises(UsageError, match=r"a\.png: --draw would overwrite it"):
        find_sources([str(tmp_path / "a.png")], tmp_path)


def test_a_copy_that_cannot_be_written(tmp_path):
    (tmp_path / "drawn").write_text("a file")
    Image.fromarray(bars(3)).save(tmp_path / "a.png")
    with pytest.raises(UsageError, match="--draw takes a folder"):
        find_sources([str(tmp_path / "a.png")], tmp_path / "drawn")
    every = find_sources([str(tmp_path / "a.png")], tmp_path / "drawn" / "deeper")
    with pytest.raises(DataError, match=r"drawn.*cannot be written"):
        list(predictions(every, Spots(), Options()))


def test_one_input_is_drawn_into_the_file_that_is_named(tmp_path):
    picture, clip = tmp_path / "a.jpg", write(tmp_path / "clip.mp4", [bars(3)] * 3)
    Image.fromarray(bars(3)).save(picture)
    for given, drawn in ((picture, "new/x.jpg"), (clip, "new/x.mp4")):
        list(predictions(find_sources([str(given)], tmp_path / drawn), Spots(), Options()))
        assert (tmp_path / drawn).is_file()
    for given, drawn, says in (
        ([picture], "x.mp4", "takes a folder or a file .bmp .jpeg .jpg .png"),
        ([clip], "x.png", "takes a folder or a file .mp4"),
        ([clip], "x.avi", "takes a folder or a file .mp4"),
        ([picture, clip], "x.png", "one file for 2 pictures and videos"),
        ([picture], "a.jpg", r"a\.jpg: --draw would overwrite it"),
    ):
        with pytest.raises(UsageError, match=says):
            find_sources([str(path) for path in given], tmp_path / drawn)
    (tmp_path / "folder.png").mkdir()
    (only,) = find_sources([str(picture)], tmp_path / "folder.png")
    assert only.copy == tmp_path / "folder.png" / "a.png"


def test_a_copy_never_replaces_another_input(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.jpg", "a.png"):
        Image.fromarray(bars(3)).save(name)
    # The copy of a.jpg would be a.png.
    with pytest.raises(UsageError, match=r"a\.png: --draw would overwrite it"):
        find_sources(["a.jpg", str(tmp_path / "a.png")], Path())
