# SPDX-License-Identifier: MIT
"""Which pictures, videos and webcams a command line means."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from downstream_hpe.errors import UsageError
from downstream_hpe.prediction.video import SUFFIXES

PICTURES = {".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff"}
MEDIA = PICTURES | SUFFIXES


@dataclass(frozen=True)
class Source:
    """path: a picture or video, or the number of a webcam. copy: the file for a drawn copy, None for none."""

    path: Path | int
    copy: Path | None = None

    @property
    def name(self) -> str:
        """As messages and tables call it."""
        return f"webcam:{self.path}" if isinstance(self.path, int) else str(self.path)

    @property
    def moving(self) -> bool:
        """A video or webcam."""
        return isinstance(self.path, int) or self.path.suffix.lower() in SUFFIXES


def find_sources(
    inputs: Sequence[str], drawn: Path | None = None, leave_out: Callable[[str], None] = lambda text: None
) -> list[Source]:
    """A source an input; a folder stands for every picture and video in and below it.

    drawn: the folder for drawn copies; what lies in it is no input. Or the file of the only one: a name
    that ends as a picture's or .mp4. leave_out: called with one line where a folder also holds other
    files. Files whose names start with a dot are passed over.

    Raises
    ------
    UsageError: something that is not there, a folder with nothing to read, a webcam without a number,
        a drawn copy that would replace an input, or one file for copies of another kind or number.
    """
    found: list[Source] = []
    # Where in the folder for drawn copies the source's own goes, before its name is made unique.
    places: list[Path] = []
    for given in inputs:
        kind, _, number = given.partition(":")
        path = Path(given)
        if kind == "webcam":
            if not (number.isdecimal() and number.isascii() and len(number) <= 4):
                raise UsageError(f"{given}: expected a number, such as webcam:0")
            found.append(Source(int(number)))
            places.append(Path(f"webcam{number}.mp4"))
        elif path.is_dir():
            files = [f for f in _below(path) if drawn is None or drawn.resolve() not in f.resolve().parents]
            usable = [file for file in files if file.suffix.lower() in MEDIA]
            if not usable:
                raise UsageError(f"{path}: no picture or video in it")
            others = [str(file.relative_to(path)) for file in files if file not in set(usable)]
            if others:
                some = ", ".join(others[:3]) + (", ..." if len(others) > 3 else "")
                leave_out(f"{path}: {len(others)} files that are no picture or video skipped ({some})")
            found += map(Source, usable)
            places += [file.relative_to(path) for file in usable]
        elif path.is_file():
            found.append(Source(path))
            places.append(Path(path.name))
        else:
            raise UsageError(f"{path}: there is no such picture, video or folder; a webcam is webcam:0")
    return found if drawn is None else _with_copies(found, places, drawn)


def _below(folder: Path) -> list[Path]:
    every = (file for file in folder.rglob("*") if file.is_file())
    return sorted(f for f in every if not any(p.startswith(".") for p in f.relative_to(folder).parts))


def _with_copies(every: Sequence[Source], places: Sequence[Path], drawn: Path) -> list[Source]:
    if drawn.suffix.lower() in MEDIA and not drawn.is_dir():
        copies = [_only_copy(every, drawn)]
    elif drawn.exists() and not drawn.is_dir():
        raise UsageError(f"{drawn}: --draw takes a folder, or the name of a picture or .mp4 file")
    else:
        taken: set[Path] = set()
        copies = [drawn / _free(place, taken) for place in places]
    originals = {source.path.resolve() for source in every if isinstance(source.path, Path)}
    for copy in copies:
        if copy.resolve() in originals:
            raise UsageError(f"{copy}: --draw would overwrite it; give another folder")
    return [replace(source, copy=copy) for source, copy in zip(every, copies, strict=True)]


def _only_copy(every: Sequence[Source], file: Path) -> Path:
    if len(every) > 1:
        raise UsageError(f"{file}: one file for {len(every)} pictures and videos; give --draw a folder")
    wanted = {".mp4"} if every[0].moving else PICTURES
    if file.suffix.lower() not in wanted:
        raise UsageError(
            f"{file}: --draw of {every[0].name} takes a folder or a file {' '.join(sorted(wanted))}"
        )
    return file


def _free(path: Path, taken: set[Path]) -> Path:
    """A name of its own for a copy: PNG for pictures, MP4 for videos."""
    suffix = ".mp4" if path.suffix.lower() in SUFFIXES else ".png"
    copy = path.with_suffix(suffix)
    number = 1
    while copy in taken:
        number += 1
        copy = path.with_name(f"{path.stem}-{number}{suffix}")
    taken.add(copy)
    return copy
