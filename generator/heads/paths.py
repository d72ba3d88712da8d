# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and files that strangers chose: what may become a subject, what may be opened.

A head's folder is data, often from an archive somebody else packed. Nothing a
material file says may reach outside of that folder.
"""

from __future__ import annotations

import os
import posixpath
import re
import unicodedata
from pathlib import Path

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.encodings import is_spelled, spellings
from generator.names import name_problem

_DRIVE = re.compile(r"^[A-Za-z]:")
_LONGEST_END = 4
"""Of an absolute name, in parts."""
_NUMBER = re.compile(r"(\d+)")


class MissingFile(HeadError):
    """A file that a head names is not in the head's folder."""


def check_name(name: str, what: str) -> str:
    """``name``, if it can be an identity that later becomes part of a file name.

    Raises
    ------
    HeadError, with what is wrong.
    """
    if problem := name_problem(name):
        raise HeadError(f"the {what} {quoted(name)} {problem}; rename it")
    return name


def natural_key(text: str) -> tuple[tuple[int, int, str], ...]:
    """Sorting key that puts 2 before 10."""
    return tuple(
        (0, int(part), "") if part.isdecimal() else (1, 0, part) for part in _NUMBER.split(text) if part
    )


def find_inside(folder: Path, name: str, what: str) -> Path:
    """The file called ``name`` in ``folder`` or below it.

    Backslashes count as slashes, and upper and lower case, and the ways to write one character, are the same
    where no exact match exists: material files are mostly written on Windows. So are absolute names, of which
    the end is looked for here.

    Raises
    ------
    MissingFile: there is no such file.
    HeadError: the name is absolute and its end not here, or it leaves the folder (also through a link).
    """
    slashed = name.strip().replace("\\", "/")
    if not slashed or any(unicodedata.category(c) == "Cc" for c in slashed):
        raise HeadError(f"the {what} has the name {quoted(name)}; write a file name there")
    if slashed.startswith("/") or _DRIVE.match(slashed):
        return _find_end(folder, slashed, what)
    parts = posixpath.normpath(slashed).split("/")
    if parts[0] == "..":
        raise HeadError(f"the {what} {quoted(name)} lies outside of the head's folder; put it inside")
    found = folder
    for part in parts:
        found = _child(found, part, name, what)
    real = found.resolve()
    if not real.is_relative_to(folder.resolve()):
        raise HeadError(f"the {what} {found} is a link out of the head's folder; put the file itself there")
    if not real.is_file():
        raise HeadError(f"the {what} {found} is not a file")
    return found


def _find_end(folder: Path, name: str, what: str) -> Path:
    """The file in folder with as much of the end of an absolute name as there is one for."""
    parts = [part for part in _DRIVE.sub("", name).split("/") if part]
    for start in range(max(0, len(parts) - _LONGEST_END), len(parts)):
        try:
            return find_inside(folder, "/".join(parts[start:]), what)
        except MissingFile:
            continue
    raise HeadError(
        f"the {what} {quoted(name)} is an absolute path; put the file beside the mesh and write only its name"
    )


def find_below(folder: Path, name: str, what: str) -> Path:
    """As :func:`find_inside`, or else the first file of that name alone in ``folder`` or below it.

    For files of programs that write the path of the machine they run on.
    """
    try:
        return find_inside(folder, name, what)
    except HeadError:
        plain = name.strip().replace("\\", "/").rpartition("/")[2]
        for below, _, files in os.walk(folder):
            if plain in files:
                return find_inside(folder, Path(below, plain).relative_to(folder).as_posix(), what)
        raise


def _child(folder: Path, part: str, name: str, what: str) -> Path:
    try:
        exact = folder / part
        if exact.exists() or exact.is_symlink():
            return exact
        wanted = spellings(part)
        for other in sorted(folder.iterdir()):
            if is_spelled(other.name, wanted):
                return other
    except OSError as error:
        raise HeadError(f"cannot look for the {what} {quoted(name)} in {folder}: {error.strerror}") from error
    raise MissingFile(f"the {what} {quoted(name)} is missing; put it into {folder} or out of the mesh")
