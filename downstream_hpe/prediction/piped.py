# SPDX-License-Identifier: MIT
"""A picture or video that comes from elsewhere than a file: through a pipe, or a picture at an address."""

from __future__ import annotations

import io
import shutil
import sys
import tempfile
import urllib.request
from http.client import HTTPException
from typing import Any, BinaryIO
from urllib.error import HTTPError, URLError
from urllib.parse import unquote, urlsplit, urlunsplit

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.prediction.ffmpeg import known_host
from downstream_hpe.prediction.kinds import HEADER, Kind, kind_of, may_move
from downstream_hpe.prediction.pictures import MAX_BYTES
from downstream_hpe.prediction.video import TIMEOUT_S

STDIN = "stdin"
"""As tables and messages call what is piped in."""
ONE_PIECE = (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip", b"pnot")
"""How boxes of QuickTime and MP4 are called: what explains the frames often comes after them."""


def piped_kind() -> Kind:
    """What is piped in, by what it begins with; nothing of it is used up.

    UsageError: nothing is piped in.
    """
    if sys.stdin is None or sys.stdin.isatty():
        raise UsageError("-: nothing is piped in; expected a picture or video, as of cat clip.ts |")
    start = _start()
    if not start:
        raise UsageError("-: nothing came through the pipe; expected a picture or video")
    kind = kind_of(start, ".ts")
    return Kind.ANIMATION if kind is Kind.PICTURE and may_move(start) else kind


def piped_picture() -> io.BytesIO:
    """All that is piped in, at most MAX_BYTES."""
    return _limited(sys.stdin.buffer, STDIN)


def piped_video() -> Any:
    """What is piped in, as it comes; of MP4 and QuickTime, which are read here and there, a file with all of
    it, which is gone once it is closed."""
    if _start()[4:8] not in ONE_PIECE:
        return _Stream(sys.stdin.buffer)
    kept = tempfile.TemporaryFile()  # noqa: SIM115 - the reader closes it
    shutil.copyfileobj(sys.stdin.buffer, kept)
    kept.seek(0)
    return kept


def fetched(address: str, name: str) -> io.BytesIO:
    """The picture at an address of HTTP, at most MAX_BYTES.

    DataError: none, or no answer within TIMEOUT_S.
    """
    try:
        plain, opener = _with_password(address)
        request = urllib.request.Request(plain, headers={"User-Agent": "downstream-hpe"})
        with opener.open(request, timeout=TIMEOUT_S) as answer:
            return _limited(answer, name)
    except HTTPError as error:
        why = str(error.reason).partition("\n")[0]
        raise DataError(f"{name}: there is no picture ({error.code} {why})") from error
    except (OSError, ValueError, HTTPException) as error:
        cause = error.reason if isinstance(error, URLError) else error
        if isinstance(cause, TimeoutError):
            raise DataError(f"{name}: does not answer within {TIMEOUT_S:g} s") from error
        if not known_host(address):
            raise DataError(f"{name}: there is no such host, or no network") from error
        # Some exceptions of HTTP tell the address, which may hold a password.
        said = getattr(cause, "strerror", None) or type(cause).__name__
        raise DataError(f"{name}: cannot be read ({said})") from error


def _with_password(address: str) -> tuple[str, urllib.request.OpenerDirector]:
    """An address without user and password, and who says them where they are asked for."""
    parts = urlsplit(address)
    plain = urlunsplit(parts._replace(netloc=parts.netloc.rpartition("@")[2]))
    known = urllib.request.HTTPPasswordMgrWithDefaultRealm()
    if parts.username is not None:
        known.add_password(None, plain, unquote(parts.username), unquote(parts.password or ""))
    basic, digest = urllib.request.HTTPBasicAuthHandler(known), urllib.request.HTTPDigestAuthHandler(known)
    return plain, urllib.request.build_opener(basic, digest)


class _Stream(io.RawIOBase):
    """What can be read once, from its beginning to its end."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream

    def readable(self) -> bool:
        return True

    def read(self, size: int = -1) -> bytes:
        """At most so many bytes, as soon as there are any."""
        reader = getattr(self._stream, "read1", self._stream.read)
        content: bytes = reader(size)
        return content


def _start() -> bytes:
    stdin: Any = sys.stdin.buffer
    start: bytes = stdin.peek(HEADER)[:HEADER]
    return start


def _limited(stream: BinaryIO, name: str) -> io.BytesIO:
    content = stream.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise DataError(f"{name}: larger than {MAX_BYTES:,} bytes")
    return io.BytesIO(content)
