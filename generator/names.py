# SPDX-License-Identifier: GPL-3.0-or-later
"""Names and paths that strangers chose: what may become a file's name, what may be opened. stdlib only.

The subjects of a folder of heads, the rows of a dataset, the parts of a manifest: all are data, often from
an archive somebody else packed. A :data:`Name` is one folder or file name on every system; an
:data:`InsidePath` leads from a folder to a file below it and nowhere else. Both are made here alone.
"""

from __future__ import annotations

import re
import unicodedata
from pathlib import Path
from typing import NewType

Name = NewType("Name", str)
"""Text that is a single file or folder name, on every system."""

InsidePath = NewType("InsidePath", str)
"""Names joined by "/": a path that cannot leave the folder it is joined to, if that holds no links."""

MAX_NAME_LENGTH = 100
MAX_NAME_BYTES = 200
"""With a suffix and a prefix still a file name, which has at most 255 bytes."""

_RESERVED = frozenset('/\\<>:"|?*')
_DRIVE = re.compile(r"[A-Za-z]:")
_DEVICE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


def name_problem(text: str) -> str:
    """What keeps text from being a :data:`Name`, as the end of a sentence; "" if nothing does.

    It is empty or long, holds a path separator, "..", a control character or bytes that are not
    text, begins or ends with a dot or a blank, or is what Windows calls a device.
    """
    if not text or len(text) > MAX_NAME_LENGTH:
        return f"must have 1 to {MAX_NAME_LENGTH} characters"
    if any(unicodedata.category(c).startswith(("C", "Z")) and c != " " for c in text):
        return "holds characters that cannot be printed"
    if set(text) & _RESERVED or ".." in text or text.strip(" .") != text:
        return "could be mistaken for a path"
    if len(text.encode()) > MAX_NAME_BYTES:
        return f"has more than {MAX_NAME_BYTES} bytes"
    return "is a device in Windows" if _DEVICE.fullmatch(text) else ""


def is_text(text: str) -> bool:
    """Can it be written as UTF-8? The name of a file may hold bytes that cannot be read as text."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def as_name(text: object) -> Name:
    """Text as a name. Raises ValueError, with what is wrong, if it is none."""
    if not isinstance(text, str):
        raise ValueError(f"is {type(text).__name__}, no text")
    if problem := name_problem(text):
        raise ValueError(problem)
    return Name(text)


def as_inside_path(text: object) -> InsidePath:
    """Text as a path of names. Raises ValueError, with what is wrong, if it is none."""
    if not isinstance(text, str):
        raise ValueError(f"is {type(text).__name__}, no text")
    for piece in text.split("/"):
        if name_problem(piece):
            raise ValueError("is no path inside the folder")
    return InsidePath(text)


def source_path_problem(text: str, *, above: bool = False) -> str:
    """What keeps text from being a file below a folder of heads, or "".

    Files of heads may have names that no :data:`Name` has; but none is absolute, and none leaves the folder,
    unless above says that it may lie beside or above that: a .blend names files anywhere.
    """
    pieces = text.replace("\\", "/").split("/")
    while above and len(pieces) > 1 and pieces[0] == "..":
        del pieces[0]
    if "\0" in text or ".." in pieces or "" in pieces or _DRIVE.match(pieces[0]):
        return "is no path inside the folder of the heads"
    return ""


def inside(root: Path, path: InsidePath) -> Path:
    """The file that path names under root.

    Raises ValueError: a link on the way leads out of root. Links of root itself are the user's.
    """
    file = root / path
    if not file.resolve().is_relative_to(root.resolve()):
        raise ValueError("is a link out of the folder")
    return file
