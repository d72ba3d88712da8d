# SPDX-License-Identifier: MIT
"""What is read: the endings of pictures and videos, said once, and how files of either begin."""

from __future__ import annotations

from enum import Enum
from pathlib import Path

PICTURES = frozenset(
    (
        ".png", ".apng", ".jpg", ".jpeg", ".jpe", ".jfif", ".bmp", ".dib", ".webp", ".tif", ".tiff",
        ".gif", ".ppm", ".pgm", ".pbm", ".pnm", ".avif", ".avifs", ".heic", ".heics", ".heif",
        ".heifs", ".hif", ".exr", ".hdr",
    )
)  # fmt: skip
VIDEOS = frozenset(
    (
        ".mp4", ".m4v", ".mov", ".qt", ".3gp", ".3g2", ".avi", ".divx", ".mkv", ".webm", ".mpg",
        ".mpeg", ".mpe", ".vob", ".ts", ".mts", ".m2ts", ".m2t", ".flv", ".f4v", ".wmv", ".asf",
        ".ogv", ".mxf", ".dv", ".mjpg", ".mjpeg", ".h264", ".264", ".hevc", ".h265", ".265", ".y4m",
        ".ivf",
    )
)  # fmt: skip
MEDIA = PICTURES | VIDEOS
DRAWN_PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff")
"""What copies can be written as."""
DRAWN_VIDEOS = (".mp4",)

HEADER = 400
"""Bytes of a file that say what it is."""
JPEG = b"\xff\xd8\xff"
_HEIF = (b"hei", b"hev", b"mif", b"msf")
_AVIF = (b"avi",)
_TIFF = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_PICTURE_MARKS = (
    b"\x89PNG\r\n", JPEG, b"BM", *_TIFF, b"GIF8", b"v/1\x01", b"#?RADIANCE", b"#?RGBE",
    b"P1", b"P2", b"P3", b"P4", b"P5", b"P6",
)  # fmt: skip
_VIDEO_MARKS = (
    (4, b"ftyp"), (4, b"moov"), (4, b"mdat"), (4, b"wide"), (4, b"pnot"),
    (0, b"\x1a\x45\xdf\xa3"), (8, b"AVI "), (0, b"\x30\x26\xb2\x75"), (0, b"FLV"), (0, b"OggS"),
    (0, b"\0\0\x01\xba"), (0, b"\0\0\x01\xb3"), (0, b"YUV4MPEG2"), (0, b"DKIF"),
)  # fmt: skip
_TS_PACKET = 188


class Kind(Enum):
    """What a file is taken for. ANIMATION: several pictures, each with its time, in a picture's format."""

    PICTURE = "picture"
    ANIMATION = "animation"
    VIDEO = "video"


def kind_of(start: bytes, ending: str) -> Kind:
    """By what a file begins with, and by its ending where that says nothing; a picture where neither does.

    Whether one that may be an ANIMATION is one, Pillow has to say: here it is a PICTURE.
    """
    ending = ending.lower()
    if is_heif(start) or is_avif(start) or (start[:4] == b"RIFF" and start[8:12] == b"WEBP"):
        return Kind.PICTURE
    if start.startswith(_PICTURE_MARKS) and ending not in (".mjpg", ".mjpeg"):
        return Kind.PICTURE
    if any(start[place:].startswith(mark) for place, mark in _VIDEO_MARKS) or is_transport_stream(start):
        return Kind.VIDEO
    return Kind.VIDEO if ending in VIDEOS else Kind.PICTURE


def kind_of_file(path: Path) -> Kind:
    """:func:`kind_of` a regular file; one that cannot be opened goes by its ending."""
    try:
        with path.open("rb") as file:
            start = file.read(HEADER)
    except OSError:
        start = b""
    return kind_of(start, path.suffix)


def instead(start: bytes) -> str:
    """What a file that is neither picture nor video plainly is, by how it begins; empty where that says
    nothing."""
    if not start:
        return "; it is empty"
    text = start.isascii() and start.decode("ascii").replace("\n", " ").replace("\r", " ").isprintable()
    return "; it holds text" if text else ""


def is_heif(start: bytes) -> bool:
    """Whether a file begins as HEIC."""
    return start[4:8] == b"ftyp" and start[8:11] in _HEIF


def is_avif(start: bytes) -> bool:
    """Whether a file begins as AVIF."""
    return start[4:8] == b"ftyp" and start[8:11] in _AVIF


def is_tiff(start: bytes) -> bool:
    """Whether a file begins as TIFF."""
    return start.startswith(_TIFF)


def is_float(start: bytes) -> bool:
    """Whether a file begins as OpenEXR or Radiance HDR."""
    return start.startswith((b"v/1\x01", b"#?RADIANCE", b"#?RGBE"))


def may_move(start: bytes) -> bool:
    """Whether what begins as a picture may have several frames, of what is read once."""
    webp = start[8:12] == b"WEBP" and start[12:16] == b"VP8X" and bool(start[20] & 2)
    return start.startswith(b"GIF8") or webp or (start.startswith(b"\x89PNG") and b"acTL" in start)


def is_transport_stream(start: bytes) -> bool:
    """Whether a file begins as MPEG-TS, with or without the times of M2TS; else a .ts may be a program."""
    return any(start[at : at + 1] == b"G" == start[at + step : at + step + 1] for at, step in _TS_STEPS)


_TS_STEPS = ((0, _TS_PACKET), (4, _TS_PACKET + 4), (0, _TS_PACKET + 16))
