# SPDX-License-Identifier: MIT
"""Videos as phones and cameras write them: turned, with times of their own, in many containers, cut off."""

from __future__ import annotations

import io
import os
import sys
from fractions import Fraction

import numpy as np
import pytest
from clips import bars, corners, make, quarters, rows_of
from PIL import Image

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.prediction import webcam
from downstream_hpe.prediction.clock import RisingClock
from downstream_hpe.prediction.display import shown
from downstream_hpe.prediction.inputs import find_sources
from downstream_hpe.prediction.kinds import Kind
from downstream_hpe.prediction.opened import open_reader
from downstream_hpe.prediction.video import VideoReader
from downstream_hpe.prediction.video_file import VideoWriter

av = pytest.importorskip("av")


def test_jpegs_in_a_row_may_have_exif(tmp_path):
    file, exif = io.BytesIO(), Image.Exif()
    exif[0x0112] = 6
    Image.fromarray(np.rot90(quarters())).save(file, "JPEG", quality=95, exif=exif)
    (tmp_path / "a.mjpeg").write_bytes(3 * file.getvalue())
    frames = list(VideoReader(tmp_path / "a.mjpeg"))
    assert [corners(image) for image, _ in frames] == 3 * [[40, 100, 160, 220]]


def test_frames_that_are_damaged_are_told(tmp_path):
    path = make(tmp_path / "a.mov", "png", [bars(n) for n in range(6)], pixels="rgb24")
    content = bytearray(path.read_bytes())
    third = content.index(b"\x89PNG", content.index(b"\x89PNG", content.index(b"\x89PNG") + 1) + 1)
    content[third : third + 40] = bytes(40)
    path.write_bytes(content)
    rows, (note,) = rows_of(path)
    assert [row["time_s"] for row in rows] == [0.0, 0.1, 0.3, 0.4, 0.5]
    assert note == f"{path}: parts of it are damaged and left out; what there was is kept"


@pytest.mark.parametrize("ending", ["mp4", "mov", "mkv"])
@pytest.mark.parametrize("turned", [0, 90, 180, 270])
def test_a_turned_video_is_shown_as_players_show_it(ending, turned, tmp_path):
    # Stored so that the turn, counter-clockwise, makes it upright.
    stored = np.rot90(quarters(), -turned // 90)
    path = make(tmp_path / f"a.{ending}", "libx264", [stored] * 3, turned=turned)
    reader = VideoReader(path)
    frames = list(reader)
    assert reader.size == (96, 64) and len(frames) == 3
    assert all(corners(image) == [40, 100, 160, 220] for image, _ in frames)


@pytest.mark.parametrize(
    "matrix",
    [(a, 0, 0, d) for a in (1, -1) for d in (1, -1)] + [(0, b, c, 0) for b in (1, -1) for c in (1, -1)],
)
def test_every_display_matrix_moves_pixels_as_it_says(matrix):
    a, b, c, d = matrix
    pixels = np.arange(2 * 3 * 3).reshape(2, 3, 3)
    found = shown(pixels, matrix)
    for y, x in np.ndindex(2, 3):
        right, down = a * x + c * y, b * x + d * y
        # The shift that a matrix has as well keeps all of it in the picture.
        height, width = found.shape[:2]
        at = down + (height - 1) * (min(b, d) < 0), right + (width - 1) * (min(a, c) < 0)
        assert (found[at] == pixels[y, x]).all()


TIMES = [0.1 * n for n in range(10)] + [1.4 + 0.5 * n for n in range(10)]


@pytest.mark.parametrize("ending", ["mp4", "mkv", "ts", "flv", "mov"])
def test_times_are_those_of_the_frames(ending, tmp_path):
    path = make(tmp_path / f"v.{ending}", "libx264", [bars(n) for n in range(20)], TIMES)
    drawn = tmp_path / "drawn.mp4"
    rows, notes = rows_of(path, drawn=drawn)
    np.testing.assert_allclose([row["time_s"] for row in rows], TIMES, atol=0.002)
    assert notes == []  # and not that it ended early
    # The drawn copy keeps them.
    again, notes = rows_of(drawn)
    np.testing.assert_allclose([row["time_s"] for row in again], TIMES, atol=0.002)
    assert notes == []
    assert len(rows_of(path, frames=5)[0]) == 5


CONTAINERS = {
    "a.ts": ("libx264", None, "yuv420p"),
    "a.m2ts": ("libx264", "mpegts", "yuv420p"),
    "a.3gp": ("mpeg4", None, "yuv420p"),
    "a.flv": ("flv", None, "yuv420p"),
    "a.avi": ("mpeg4", None, "yuv420p"),
    "a.wmv": ("wmv2", None, "yuv420p"),
    "a.mpg": ("mpeg2video", None, "yuv420p"),
    "a.webm": ("libvpx-vp9", None, "yuv420p"),
    "a.h264": ("libx264", "h264", "yuv420p"),
    "a.mjpeg": ("mjpeg", "mjpeg", "yuvj420p"),
    "no ending": ("libx264", "matroska", "yuv420p"),
    "called.jpg": ("libx264", "mp4", "yuv420p"),
}


@pytest.mark.parametrize("name", CONTAINERS)
def test_containers_of_phones_and_cameras(name, tmp_path):
    codec, form, pixels = CONTAINERS[name]
    # Raw streams have no times, and hold back nothing: only their number is looked at.
    make(tmp_path / name, codec, [bars(20)] * 12, form=form, pixels=pixels)
    (source,) = find_sources([str(tmp_path / name)])
    assert source.kind is Kind.VIDEO
    rows, notes = rows_of(tmp_path / name)
    assert len(rows) == 12 and all(row["found"] for row in rows) and notes == []
    times = [row["time_s"] for row in rows]
    assert times[0] == 0 and (np.diff(times) > 0).all()
    if name not in ("no ending", "called.jpg"):
        assert len(find_sources([str(tmp_path)])) == 1  # and in folders by the same endings


def test_pixels_that_are_not_square_are_made_so(tmp_path):
    path = make(tmp_path / "a.mkv", "libx264", [quarters()] * 2, aspect=Fraction(4, 3))
    reader = VideoReader(path)
    assert reader.size == (128, 64)
    assert [image.shape for image, _ in reader] == [(64, 128, 3)] * 2


def test_a_codec_that_is_not_there_is_named(tmp_path):
    path = make(tmp_path / "a.mp4", "libx264", [bars(3)] * 3)
    path.write_bytes(path.read_bytes().replace(b"avc1", b"zzz9"))
    with pytest.raises(
        DataError, match=r"a\.mp4: its codec zzz9 cannot be decoded here; convert it to H\.264"
    ):
        VideoReader(path)
    path = make(tmp_path / "a.mkv", "libx264", [bars(3)] * 3)
    path.write_bytes(path.read_bytes().replace(b"V_MPEG4/ISO/AVC", b"V_NOBODY/S/ONE!"))
    with pytest.raises(DataError, match=r"a\.mkv: its codec V_NOBODY/S/ONE! cannot"):
        VideoReader(path)


def test_sound_alone_is_no_video(tmp_path):
    with av.open(str(tmp_path / "a.mp4"), "w") as container:
        stream = container.add_stream("aac", rate=8000, layout="mono")
        frame = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), "fltp", "mono")
        frame.sample_rate = 8000
        container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    with pytest.raises(DataError, match=r"a\.mp4: has no pictures, but sound"):
        VideoReader(tmp_path / "a.mp4")


@pytest.mark.parametrize("ending", ["mkv", "flv", "avi"])
def test_what_was_cut_off_says_so(ending, tmp_path):
    rng = np.random.default_rng(0)
    images = [rng.integers(0, 255, (64, 64, 3), dtype=np.uint8) for _ in range(40)]
    codec = {"flv": "flv", "avi": "mjpeg", "mkv": "libx264"}[ending]
    path = make(tmp_path / f"a.{ending}", codec, images, pixels="yuvj420p" if codec == "mjpeg" else "yuv420p")
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    rows, (note,) = rows_of(path)
    assert 5 < len(rows) < 35
    assert note.startswith(f"{path}: ended after {rows[-1]['time_s']:.2f} of 4.0") and "is kept" in note


def test_a_clock_goes_on_where_stamps_do_not():
    clock = RisingClock(None, 0.5)
    stamps = [100.0, 100.1, None, 100.1, 7.0, 7.25]
    assert [clock(stamp) for stamp in stamps] == [0.0, 0.1, 0.6, 1.1, 1.6, 1.85]
    assert RisingClock(0.0, 0.5)(0.25) == 0.25


@pytest.mark.parametrize("ending", ["gif", "webp", "png"])
def test_an_animated_picture_is_a_video(ending, tmp_path):
    images = [Image.fromarray(bars(n)) for n in (3, 20, 40)]
    path = tmp_path / f"a.{ending}"
    images[0].save(path, save_all=True, append_images=images[1:], duration=[200, 300, 100])
    rows, notes = rows_of(path, drawn=tmp_path / "drawn")
    assert [row["time_s"] for row in rows] == [0.0, 0.2, 0.5] and notes == []
    assert len({row["yaw_deg"] for row in rows}) == 3
    assert (tmp_path / "drawn" / "a.mp4").is_file()
    images[0].save(path)
    (row,), notes = rows_of(path)
    assert row["frame"] is None


@pytest.fixture
def piped(monkeypatch):
    """Call it with bytes, and they are what is piped in."""
    opened = []

    def pipe(content):
        reading, writing = os.pipe()
        if os.fork() == 0:  # pragma: no cover - a pipe holds but 64 KB
            os.close(reading)
            with os.fdopen(writing, "wb") as stream:
                stream.write(content)
            os._exit(0)
        os.close(writing)
        opened.append(os.fdopen(reading, "rb"))
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(opened[-1]))

    yield pipe
    for stream in opened:
        stream.close()
        os.wait()


@pytest.mark.parametrize("name", ["a.ts", "a.mp4", "a.mkv"])
def test_a_video_through_a_pipe(name, piped, tmp_path):
    path = make(tmp_path / name, "libx264", [bars(n) for n in range(30)])
    piped(path.read_bytes())
    rows, notes = rows_of("-")
    assert len(rows) == 30 and notes == []
    assert rows[0]["input"] == "stdin" and rows[-1]["time_s"] == pytest.approx(2.9)


def test_a_picture_through_a_pipe(piped):
    file = io.BytesIO()
    Image.fromarray(bars(20)).save(file, "PNG")
    piped(file.getvalue())
    (row,), _ = rows_of("-")
    assert row["input"] == "stdin" and row["frame"] is None and row["found"]


def test_a_pipe_with_nothing_in_it(piped, monkeypatch):
    piped(b"no video")
    rows, (note,) = rows_of("-")
    assert not rows and note.startswith("stdin: cannot be opened as video")
    piped(b"no video")
    with pytest.raises(UsageError, match="read once"):
        find_sources(["-", "-"])
    piped(b"")
    with pytest.raises(UsageError, match="-: nothing came through the pipe"):
        find_sources(["-"])
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    with pytest.raises(UsageError, match="nothing is piped in"):
        find_sources(["-"])


class Capture:
    """Stands for OpenCV's, of a webcam that gives so many frames."""

    frames = 0

    def __init__(self, number):
        self._left = self.frames

    def isOpened(self):
        return True

    def read(self):
        self._left -= 1
        return self._left >= 0, bars(20) if self._left >= 0 else None

    def release(self):
        pass


def test_a_webcam_that_is_in_use_and_one_that_is_pulled_out(tmp_path, monkeypatch):
    cv2 = pytest.importorskip("cv2")
    monkeypatch.setattr(cv2, "VideoCapture", Capture)
    monkeypatch.setattr(webcam, "DEVICES", tmp_path)
    monkeypatch.setattr(sys, "platform", "linux")
    for name in ("video0", "video2"):
        (tmp_path / name).touch()
    rows, (note,) = rows_of("webcam:0")
    assert not rows and note == "webcam:0: gives no picture: another program uses it, or it is no camera"
    _, (note,) = rows_of("webcam:5")
    assert note == "webcam:5: there is no such webcam; there is webcam:0, webcam:2"
    monkeypatch.setattr(Capture, "frames", 3)
    rows, (note,) = rows_of("webcam:0")
    assert len(rows) == 3 and note.startswith("webcam:0: gives no more pictures after 0.")
    assert len({row["time_s"] for row in rows}) == 3


def test_a_copy_whose_size_is_odd_and_one_that_cannot_be_written(tmp_path):
    with VideoWriter(tmp_path / "a.mp4") as writer:
        for n in range(3):
            writer.add(np.full((65, 95, 3), 90, np.uint8), n / 10)
    reader = open_reader(find_sources([str(tmp_path / "a.mp4")])[0])
    assert reader.size == (96, 66) and len(list(reader)) == 3
    (tmp_path / "b.mp4").mkdir()
    with (
        pytest.raises(DataError, match=r"b\.mp4: cannot be written"),
        VideoWriter(tmp_path / "b.mp4") as writer,
    ):
        writer.add(bars(3), 0.0)
