# SPDX-License-Identifier: GPL-3.0-or-later
"""ZIP archives from strangers, whose names and sizes are anybody's."""

from __future__ import annotations

import stat
import struct
import zipfile
import zlib
from collections.abc import Callable
from pathlib import Path

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.limits import MAX_MESH_BYTES, check_count, check_mesh_file
from generator.heads.paths import check_name

MAX_MEMBERS = 10_000
_ENCRYPTED = 1
_DEEPEST = 8
_PIECE = 1 << 20
_BROKEN = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    ValueError,
    LookupError,
    NotImplementedError,
)


def unpack_stored(path: Path, folder: Path, wanted: Callable[[str], bool]) -> list[Path]:
    """Unpack the wanted files of an archive that compresses nothing into an empty folder, in their order.

    Raises
    ------
    HeadError: no such archive, one that is encrypted or larger than its file, or a name that is none on
        every system, twice there, or that of a link.
    OSError: a file cannot be read or written.
    """
    check_mesh_file(path)
    try:
        with zipfile.ZipFile(path) as archive:
            entries = [entry for entry in archive.infolist() if not entry.is_dir()]
            check_count(len(entries), MAX_MEMBERS, "files in an archive")
            places = {entry: folder.joinpath(*_parts(entry)) for entry in entries}
            if sum(entry.file_size for entry in entries) > path.stat().st_size:
                raise HeadError("an archive whose files are larger than itself; pack it again, uncompressed")
            found: dict[Path, None] = {}
            for entry, target in places.items():
                if wanted(entry.filename):
                    if target in found or target.exists():
                        raise HeadError(f"{quoted(entry.filename)} is in the archive twice; pack it again")
                    target.parent.mkdir(parents=True, exist_ok=True)
                    _write(archive, entry, target)
                    found[target] = None
            return list(found)
    except _BROKEN as error:
        raise HeadError(f"not an archive that can be read ({error}); pack it again") from error


def _parts(entry: zipfile.ZipInfo) -> list[str]:
    """The folders and the name of a file. HeadError: it is none that may be unpacked."""
    parts = entry.filename.split("/")
    for part in parts:
        check_name(part, "packed file")
    check_count(len(parts), _DEEPEST, "folders within each other")
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if kind not in (0, stat.S_IFREG):
        raise HeadError(f"{quoted(entry.filename)} is a link in the archive; pack the file itself")
    if entry.flag_bits & _ENCRYPTED:
        raise HeadError("an archive that is encrypted; pack it without")
    if entry.header_offset < 0:
        raise HeadError(f"{quoted(entry.filename)} lies before the archive; pack it again")
    if entry.compress_type != zipfile.ZIP_STORED:
        raise HeadError(f"{quoted(entry.filename)} is compressed, as nothing in such an archive may be")
    return parts


def _write(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, target: Path) -> None:
    written = 0
    with archive.open(entry) as source, target.open("wb") as file:
        while piece := source.read(_PIECE):
            written += len(piece)
            check_count(written, MAX_MESH_BYTES, "bytes in an archive")
            file.write(piece)
