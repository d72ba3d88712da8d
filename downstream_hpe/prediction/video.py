# SPDX-License-Identifier: MIT
"""Videos in files, at addresses and through pipes, frame by frame, by PyAV."""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.prediction.clock import RisingClock
from downstream_hpe.prediction.display import display_matrix, shown, square_size
from downstream_hpe.prediction.ffmpeg import (
    FORMATS,
    FORMATS_OF_ADDRESSES,
    PROTOCOLS_OF_ADDRESSES,
    ffmpeg,
    known_host,
    reason,
)
from downstream_hpe.prediction.kinds import HEADER, JPEG, instead
from downstream_hpe.reading import check_regular

MAX_BYTES = 1 << 40
MAX_PIXELS = 1 << 26
"""Of a frame: 8192 x 8192."""
TIMEOUT_S = 10.0
"""So long an address is waited for: to answer, and for each further frame."""
FALLBACK_RATE = 30.0
"""Frames a second, where a camera or file does not say."""
SAYS_ITS_LENGTH = ("mov,", "matroska,", "avi", "flv", "asf")
"""How formats begin that say how long they are; of others FFmpeg guesses from what is there."""
CUT_OFF = 0.95
"""Of what a file says it lasts: one that ends before is cut off."""
CUT_OR_NONE = "; it is cut off or none"
SCALER = 0x4 | 0x2000 | 0x4000 | 0x40000
"""libswscale's SWS_BICUBIC, FULL_CHR_H_INT, FULL_CHR_H_INP and ACCURATE_RND: every pixel has its own colour.
Without them two share one across, and how a phone was held changes a pose by two degrees."""

Frame = tuple[np.ndarray, float]
"""uint8 [H, W, 3], BGR, upright, and its time in seconds."""


class VideoReader:
    """Frames of a file (a Path), an address (a text) or a pipe. Close it.

    size: width and height of a frame, pixels. name: as messages call it.

    Raises
    ------
    DataError: it cannot be opened, or not decoded. ModelError: PyAV is missing.
    """

    def __init__(self, source: Path | str | BinaryIO, name: str | None = None) -> None:
        self._av = ffmpeg()
        self._name = name = str(source) if name is None else name
        self._address = isinstance(source, str)
        if isinstance(source, Path):
            _check_file(source)
        self._piped = None if isinstance(source, Path | str) else source
        self._waiting_since = time.monotonic()
        self._broken: str | None = None
        self._seen_s = 0.0
        self._lost = False
        try:
            self._container = self._opened(source)
        # ValueError: a name that PyAV cannot pass on.
        except (self._av.error.FFmpegError, ValueError) as error:
            self._close_pipe()
            raise DataError(f"{name}: {self._why(error, source)}") from error
        try:
            self._prepare()
        except BaseException:
            self.close()
            raise

    def _opened(self, source: Path | str | BinaryIO) -> Any:
        if isinstance(source, str):
            only = {
                "protocol_whitelist": PROTOCOLS_OF_ADDRESSES,
                "format_whitelist": FORMATS_OF_ADDRESSES,
                # UDP loses packets at cameras far away, and their frames are grey below.
                "rtsp_flags": "prefer_tcp",
            }
            return self._av.open(source, container_options=only, timeout=TIMEOUT_S, metadata_errors="replace")
        only = {"protocol_whitelist": "file", "format_whitelist": FORMATS}
        place = f"file:{source.absolute()}" if isinstance(source, Path) else source
        # Of JPEGs in a row, those with EXIF look like a single picture to FFmpeg.
        jpegs = isinstance(source, Path) and _start(source).startswith(JPEG)
        form = "mjpeg" if jpegs else None
        return self._av.open(place, format=form, container_options=only, metadata_errors="replace")

    def _why(self, error: Exception, source: Path | str | BinaryIO) -> str:
        if isinstance(source, Path):
            return f"cannot be opened as video{instead(_start(source)) or CUT_OR_NONE}"
        if not isinstance(source, str):
            return f"cannot be opened as video{CUT_OR_NONE}"
        if self._waited(error):
            return f"does not answer within {TIMEOUT_S:g} s"
        if not known_host(source):
            return "there is no such host, or no network"
        return f"cannot be opened as video ({reason(error)})"

    def _waited(self, error: Exception) -> bool:
        """Whether an error is that of a time-out, which has no kind of its own for every protocol."""
        late = time.monotonic() - self._waiting_since > 0.98 * TIMEOUT_S
        return self._address and (late or isinstance(error, self._av.error.ExitError))

    def _prepare(self) -> None:
        """Find the video among the streams, and decode its first frame: that says which way up it is."""
        name, container = self._name, self._container
        best = container.streams.best("video") or next(iter(container.streams.video), None)
        if best is None:
            raise DataError(f"{name}: has no pictures, but sound or other data alone")
        self._stream: Any = best
        context = best.codec_context
        if context is None:
            raise DataError(f"{name}: its codec {self._codec()} cannot be decoded here; convert it to H.264")
        if context.width * context.height > MAX_PIXELS:
            raise DataError(f"{name}: frames of {context.width} x {context.height} pixels; make them smaller")
        # What has a size is a file, wherever it lies.
        self._live = self._address and not (container.format.name != "rtsp" and container.size > 0)
        context.thread_type = "SLICE" if self._live else "AUTO"
        self._aspect = self._stream.sample_aspect_ratio
        rate = self._stream.average_rate or self._stream.guessed_rate
        rate = float(rate) if rate and 0 < rate < 1000 else FALLBACK_RATE
        origin_s = None
        if container.start_time is not None and not self._live:
            # Where a player begins; before zero lies but what a codec of sound starts with.
            origin_s = max(0.0, container.start_time / self._av.time_base)
        self._clock = RisingClock(origin_s, 1 / rate)
        lasts_s = (container.duration or 0) / self._av.time_base
        if container.format.name == "avi":
            # There FFmpeg counts what fits in the file, and a frame has no time but by its number.
            lasts_s = max(lasts_s, best.frames / rate)
        says = container.format.name.startswith(SAYS_ITS_LENGTH)
        self._duration_s = lasts_s if says and lasts_s > 0 else None
        self.size = (0, 0)
        self._frames = self._decoded()
        self._first = next(self._frames, None)
        if self._first is None:
            what = self._broken or "it is cut off or damaged"
            raise DataError(f"{name}: no frame of it can be decoded ({context.name}); {what}")

    def _codec(self) -> str:
        """What the video is coded with, by what FFmpeg finds, or by Matroska's own name."""
        log = self._av.logging
        level = log.get_level()
        log.set_level(log.INFO)  # below it, FFmpeg describes nothing
        try:
            described = self._container.dumps_format()
        finally:
            log.set_level(level)
        found = re.search(r"Video: (\w+)(?:[^,(]*\((\S{4}) /)?", described)
        name, code = found.groups() if found else ("", None)
        if name not in ("", "none"):
            return str(name)
        if code is None and isinstance(self._container.name, str):
            with Path(self._container.name.removeprefix("file:")).open("rb") as file:
                own = re.search(rb"\x86[\x81-\xff](V_[!-~]+)", file.read(1 << 20))
            code = own.group(1).decode("ascii") if own else None
        return str(code or "is not known, and")

    def _decoded(self) -> Iterator[Frame]:
        errors = self._av.error
        for packet in self._packets():
            try:
                frames = self._stream.codec_context.decode(packet)
            except errors.FFmpegError:
                # What is damaged is passed over, as players do. A stream begins anywhere.
                self._lost |= self._clock.last_s is not None and not self._live
                continue
            for frame in frames:
                if frame.width * frame.height > MAX_PIXELS:
                    self._broken = f"a frame of {frame.width} x {frame.height} pixels; make it smaller"
                    return
                stamp_s = None if frame.pts is None else float(frame.pts * self._stream.time_base)
                yield self._upright(frame), self._clock(stamp_s)

    def _packets(self) -> Iterator[Any]:
        """Those of the video, and at the end None, which has the decoder give what it holds back."""
        packets = self._container.demux()
        while True:
            self._waiting_since = time.monotonic()
            try:
                packet = next(packets, None)
            except self._av.error.FFmpegError as error:
                waited = self._waited(error)
                self._broken = f"nothing came for {TIMEOUT_S:g} s" if waited else reason(error)
                packet = None
            if packet is None:
                yield None
                return
            if packet.pts is not None:
                end_s = float((packet.pts + (packet.duration or 0)) * packet.time_base)
                self._seen_s = max(self._seen_s, end_s)
            # An empty one stands for the end of a stream.
            if packet.size and packet.stream.index == self._stream.index:
                yield packet

    def _upright(self, frame: Any) -> np.ndarray:
        matrix = display_matrix(frame)
        width, height = square_size(frame.width, frame.height, self._aspect)
        if self.size != (0, 0):
            # A stream may change its size; what was found before is in the pixels of the first.
            width, height = self.size if matrix[0] else self.size[::-1]
        bgr = frame.to_ndarray(format="bgr24", width=width, height=height, interpolation=SCALER)
        upright = np.ascontiguousarray(shown(bgr, matrix))
        self.size = (upright.shape[1], upright.shape[0])
        return upright

    def shortfall(self) -> str | None:
        """One line, once all frames were asked for, where fewer came than there should be; else None."""
        last_s = self._clock.last_s or 0.0
        if self._broken is not None:
            return f"{self._name}: broke off after {last_s:.2f} s ({self._broken}); what there was is kept"
        duration = self._duration_s
        if duration is not None:
            if self._seen_s < CUT_OFF * duration - self._clock.longest_s:
                return f"{self._name}: ended after {last_s:.2f} of {duration:.2f} s; what there was is kept"
        elif self._live:
            return f"{self._name}: the stream ended after {last_s:.2f} s; what there was is kept"
        if self._lost:
            return f"{self._name}: parts of it are damaged and left out; what there was is kept"
        return None

    def __iter__(self) -> Iterator[Frame]:
        """Ends with the last whole frame, also of a file that was cut off."""
        if self._first is not None:
            yield self._first
        self._first = None
        yield from self._frames

    def close(self) -> None:
        """Let go of it."""
        self._container.close()
        self._close_pipe()

    def _close_pipe(self) -> None:
        if self._piped is not None:
            self._piped.close()


def _start(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(HEADER)


def _check_file(path: Path) -> None:
    try:
        check_regular(path, MAX_BYTES)
        with path.open("rb"):
            pass
    except OSError as error:
        raise DataError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise DataError(f"{path}: {error}") from error
