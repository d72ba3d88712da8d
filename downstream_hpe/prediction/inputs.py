# SPDX-License-Identifier: MIT
"""Which pictures, videos, webcams and addresses a command line means."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from urllib.parse import urlsplit

from downstream_hpe.errors import UsageError
from downstream_hpe.prediction.animation import is_animated
from downstream_hpe.prediction.kinds import (
    DRAWN_PICTURES,
    DRAWN_VIDEOS,
    HEADER,
    MEDIA,
    PICTURES,
    Kind,
    is_transport_stream,
    kind_of_file,
)
from downstream_hpe.prediction.piped import STDIN, piped_kind

SCHEMES = ("http", "https", "rtsp", "rtsps", "rtmp", "rtmps", "udp", "tcp")
"""Of addresses."""
NEVER_FOLDERS = MEDIA | {".pdf", ".svg", ".eps", ".ps", ".psd", ".ico", ".jp2", ".jxl"}
"""Endings of what a drawn copy may be meant to be."""
EXPECTED = "a picture, a video, a folder, an address, webcam:0, or - for what is piped in"


@dataclass(frozen=True)
class Source:
    """path: a file, the number of a webcam, an address, or STDIN. copy: the file for a drawn copy, None for
    none."""

    path: Path | int | str
    kind: Kind = Kind.VIDEO
    copy: Path | None = None

    @property
    def name(self) -> str:
        """As messages and tables call it: without the password of an address."""
        if isinstance(self.path, int):
            return f"webcam:{self.path}"
        return without_password(self.path) if isinstance(self.path, str) else str(self.path)

    @property
    def moving(self) -> bool:
        """Several frames, each with its time."""
        return self.kind is not Kind.PICTURE

    @property
    def alone(self) -> bool:
        """A webcam, an address or a pipe: what may go on until somebody stops it."""
        return not isinstance(self.path, Path)


def find_sources(
    inputs: Sequence[str], drawn: Path | None = None, leave_out: Callable[[str], None] = lambda text: None
) -> list[Source]:
    """A source an input; a folder stands for every picture and video in and below it, by their endings.
    A file that is named is taken for what it begins with.

    drawn: the folder for drawn copies; what lies in it is no input. Or the file of the only one: a name
    that ends as a picture's or .mp4. leave_out: called with one line where a folder also holds other
    files. Files whose names start with a dot are passed over.

    Raises
    ------
    UsageError: something that is not there, a folder with nothing to read, a webcam without a number, an
        address of no known kind, a drawn copy that would replace an input, or one file for copies of another
        kind or number.
    """
    found: list[Source] = []
    # Where in the folder for drawn copies the source's own goes, before its name is made unique.
    places: list[Path] = []
    for given in inputs:
        if not given.strip():
            raise UsageError(f"{given!r} is no input; expected {EXPECTED}")
        path = Path(given)
        if given == "-":
            if any(source.path == STDIN for source in found):
                raise UsageError("-: what is piped in is read once")
            found.append(Source(STDIN, piped_kind()))
            places.append(Path(STDIN))
        elif given.startswith("webcam:"):
            number = given.partition(":")[2]
            if not (number.isdecimal() and number.isascii() and len(number) <= 4):
                raise UsageError(f"{given}: expected a number, such as webcam:0")
            found.append(Source(int(number)))
            places.append(Path(f"webcam{number}"))
        elif "://" in given:
            found.append(_at_address(given))
            places.append(Path(_last_name(given)))
        elif path.is_dir():
            usable = _usable(path, drawn, leave_out)
            found += [Source(file, _kind(file)) for file in usable]
            places += [file.relative_to(path) for file in usable]
        elif path.is_file():
            found.append(Source(path, _kind(path)))
            places.append(Path(path.name))
        elif path.exists():
            raise UsageError(f"{path}: neither a file nor a folder; what comes through a pipe is read from -")
        else:
            raise UsageError(f"{path}: there is no such picture, video or folder; expected {EXPECTED}")
    return found if drawn is None else _with_copies(found, places, drawn)


def check_output(file: Path, every: Sequence[Source], *others: Path | None) -> None:
    """UsageError: a file that is to be written is one of those that are read: an input, or another one."""
    read = [source.path for source in every if isinstance(source.path, Path)]
    for path in (*read, *(other for other in others if other is not None)):
        if file.resolve() == path.resolve():
            raise UsageError(f"{file}: --out would overwrite what is read; give another file")


def without_password(address: str) -> str:
    """An address as it may be shown."""
    scheme, slashes, rest = address.partition("://")
    host, slash, path = rest.partition("/")
    user, at, host = host.rpartition("@")
    if ":" in user:
        user = user.partition(":")[0] + ":***"
    return scheme + slashes + user + at + host + slash + path


def _at_address(given: str) -> Source:
    try:
        parts = urlsplit(given)
        known = parts.scheme.lower() in SCHEMES and bool(parts.hostname) and (parts.port or 1) > 0
    except ValueError:
        known = False
    if not known:
        raise UsageError(
            f"{without_password(given)}: expected an address SCHEME://HOST..., of {', '.join(SCHEMES)}"
        )
    ending = (Path(parts.path).suffix or Path(parts.query).suffix).lower()
    if parts.scheme.lower() not in ("http", "https") or ending not in PICTURES:
        return Source(given, Kind.VIDEO)
    return Source(given, Kind.ANIMATION if ending == ".gif" else Kind.PICTURE)


def _last_name(address: str) -> str:
    """Of an address, fit for a file."""
    parts = urlsplit(address)
    name = Path(parts.path).name or parts.hostname or ""
    return "".join(c if c.isalnum() or c in "-_." else "_" for c in name).lstrip(".") or "address"


def _usable(folder: Path, drawn: Path | None, leave_out: Callable[[str], None]) -> list[Path]:
    files = [f for f in _below(folder) if drawn is None or drawn.resolve() not in f.resolve().parents]
    usable = [file for file in files if file.suffix.lower() in MEDIA and not _is_program(file)]
    if not usable:
        raise UsageError(f"{folder}: no picture or video in it")
    others = [str(file.relative_to(folder)) for file in files if file not in set(usable)]
    if others:
        some = ", ".join(others[:3]) + (", ..." if len(others) > 3 else "")
        leave_out(f"{folder}: {len(others)} files that are no picture or video skipped ({some})")
    return usable


def _is_program(file: Path) -> bool:
    """Whether it ends as MPEG-TS and is TypeScript, say."""
    if file.suffix.lower() not in (".ts", ".mts"):
        return False
    with file.open("rb") as opened:
        return not is_transport_stream(opened.read(HEADER))


def _kind(file: Path) -> Kind:
    kind = kind_of_file(file)
    return Kind.ANIMATION if kind is Kind.PICTURE and is_animated(file) else kind


def _below(folder: Path) -> list[Path]:
    every = (file for file in folder.rglob("*") if file.is_file())
    return sorted(f for f in every if not any(p.startswith(".") for p in f.relative_to(folder).parts))


def _with_copies(every: Sequence[Source], places: Sequence[Path], drawn: Path) -> list[Source]:
    if drawn.suffix.lower() in NEVER_FOLDERS and not drawn.is_dir():
        copies = [_only_copy(every, drawn)]
    elif drawn.exists() and not drawn.is_dir():
        raise UsageError(f"{drawn}: --draw takes a folder, or the name of a picture or .mp4 file")
    else:
        taken: set[Path] = set()
        moving = [source.moving for source in every]
        copies = [drawn / _free(*one, taken) for one in zip(places, moving, strict=True)]
    originals = {source.path.resolve() for source in every if isinstance(source.path, Path)}
    for copy in copies:
        if copy.resolve() in originals:
            raise UsageError(f"{copy}: --draw would overwrite it; give another folder")
    return [replace(source, copy=copy) for source, copy in zip(every, copies, strict=True)]


def _only_copy(every: Sequence[Source], file: Path) -> Path:
    if len(every) > 1:
        raise UsageError(f"{file}: one file for {len(every)} pictures and videos; give --draw a folder")
    wanted = DRAWN_VIDEOS if every[0].moving else DRAWN_PICTURES
    if file.suffix.lower() not in wanted:
        raise UsageError(
            f"{file}: --draw of {every[0].name} takes a folder or a file {' '.join(sorted(wanted))}"
        )
    return file


def _free(path: Path, moving: bool, taken: set[Path]) -> Path:
    """A name of its own for a copy: PNG for pictures, MP4 for videos."""
    suffix = DRAWN_VIDEOS[0] if moving else DRAWN_PICTURES[0]
    stem = path.stem if path.suffix.lower() in MEDIA else path.name
    copy = path.with_name(stem + suffix)
    number = 1
    while copy in taken:
        number += 1
        copy = path.with_name(f"{stem}-{number}{suffix}")
    taken.add(copy)
    return copy
