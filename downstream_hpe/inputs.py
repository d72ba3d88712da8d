# SPDX-License-Identifier: MIT
"""Which pictures, videos and webcams a command line means."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from downstream_hpe.errors import UsageError
from downstream_hpe.video import SUFFIXES

PICTURES = {".png", ".jpg", ".jpeg", ".bmp", ".webp", ".tif", ".tiff"}


@dataclass(frozen=True)
class Source:
    """path: a picture or video, or the number of a webcam. copy: where a drawn copy goes, relative."""

    path: Path | int
    copy: Path

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

    drawn: the folder for drawn copies; what lies in it is no input. leave_out: called with one line where
    a folder also holds other files. Files whose names start with a dot are passed over.

    Raises
    ------
    UsageError: something that is not there, a folder with nothing to read, a webcam without a number,
        or a drawn copy that would replace its own picture.
    """
    found: list[Source] = []
    taken: set[Path] = set()
    for given in inputs:
        kind, _, number = given.partition(":")
        path = Path(given)
        if kind == "webcam":
            if not number.isdigit():
                raise UsageError(f"{given}: expected a number, such as webcam:0")
            found.append(Source(int(number), _copy(Path(f"webcam{number}.mp4"), taken)))
        elif path.is_dir():
            files = [file for file in _below(path) if drawn is None or drawn not in file.parents]
            usable = [file for file in files if file.suffix.lower() in PICTURES | SUFFIXES]
            if not usable:
                raise UsageError(f"{path}: no picture or video in it")
            others = [str(file.relative_to(path)) for file in files if file not in set(usable)]
            if others:
                some = ", ".join(others[:3]) + (", ..." if len(others) > 3 else "")
                leave_out(f"{path}: {len(others)} files that are no picture or video skipped ({some})")
            found += [Source(file, _copy(file.relative_to(path), taken)) for file in usable]
        elif path.is_file():
            found.append(Source(path, _copy(Path(path.name), taken)))
        else:
            raise UsageError(f"{path}: there is no such picture, video or folder")
    for source in found:
        if drawn is not None and source.path == drawn / source.copy:
            raise UsageError(f"{source.name}: --draw would overwrite it; give another folder")
    return found


def _below(folder: Path) -> list[Path]:
    every = (file for file in folder.rglob("*") if file.is_file())
    return sorted(f for f in every if not any(p.startswith(".") for p in f.relative_to(folder).parts))


def _copy(path: Path, taken: set[Path]) -> Path:
    """A name of its own for a copy: PNG for pictures, MP4 for videos."""
    suffix = ".mp4" if path.suffix.lower() in SUFFIXES else ".png"
    copy = path.with_suffix(suffix)
    number = 1
    while copy in taken:
        number += 1
        copy = path.with_name(f"{path.stem}-{number}{suffix}")
    taken.add(copy)
    return copy
