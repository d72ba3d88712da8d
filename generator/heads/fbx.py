# SPDX-License-Identifier: GPL-3.0-or-later
"""What a binary FBX names and holds, before Blender's importer opens whatever it finds there.

Records of an FBX are walked without unpacking one: its images, by the importer's own rule for their names,
and how large everything would be.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from generator.errors import HeadError
from generator.heads.limits import (
    MAX_DEPTH,
    MAX_GEOMETRY_BYTES,
    MAX_MATERIALS,
    MAX_NODES,
    check_count,
    check_mesh_file,
)
from generator.heads.paths import MissingFile, find_below
from generator.heads.textures import check_picture

_MAGIC = b"Kaydara FBX Binary  \0"
_HEADER = 27
_SINCE_64_BIT = 7500
MAX_RECORDS = 1_000_000
MAX_NAME = 4096
_PIECE = 1 << 20
_PLAIN = {b"Z": 1, b"Y": 2, b"B": 1, b"C": 1, b"I": 4, b"F": 4, b"D": 8, b"L": 8}
_ARRAYS = {b"b": 1, b"c": 1, b"i": 4, b"l": 8, b"f": 4, b"d": 8}
_NAMES = (b"RelativeFilename", b"FileName", b"Filename")
"""The importer takes the first of them that is not empty."""
_NOT_DRAWN = frozenset(
    b"NormalMap Bump BumpFactor DisplacementColor VectorDisplacementColor SpecularColor SpecularFactor "
    b"Shininess ShininessExponent ReflectionColor ReflectionFactor EmissiveColor EmissiveFactor".split()
)
"""What a texture may be of a material without being seen here: the renderer owns light and gloss."""

_LIMITS = {
    b"Material": MAX_MATERIALS,
    b"Texture": MAX_MATERIALS,
    b"Video": MAX_MATERIALS,
    b"Model": MAX_NODES,
}


@dataclass
class _Picture:
    """A record Texture or Video. names: of each of _NAMES, as it stands first. number: that links name it by,
    0 in files older than those."""

    own: str
    number: int = 0
    names: dict[bytes, str] = field(default_factory=dict)
    content: bytes = b""

    @property
    def name(self) -> str:
        return next((self.names[key] for key in _NAMES if self.names.get(key)), self.own)


def check_fbx(path: Path) -> tuple[str, ...]:
    """The textures of colour or opacity that are missing, a line each.

    Raises
    ------
    HeadError: no binary FBX, one that would not unpack to a sane size, or a texture that lies outside of
        the folder or is none.
    OSError: no regular file, or it cannot be read.
    """
    check_mesh_file(path)
    try:
        with path.open("rb") as file:
            reader = _Reader(file, path.stat().st_size)
            pictures = reader.pictures()
    except (ValueError, struct.error, zlib.error) as error:
        raise HeadError(f"not a binary FBX that can be read ({error}); export it again, or as GLB") from error
    embedded = {picture.name for picture in pictures if picture.content}
    problems = []
    for picture in pictures:
        try:
            if picture.content:
                check_picture(io.BytesIO(picture.content), picture.name)
            elif picture.name and picture.name not in embedded:
                check_picture(find_below(path.parent, picture.name, "texture"), picture.name)
        except MissingFile as error:
            if reader.is_drawn(picture):
                problems.append(str(error))
    return tuple(dict.fromkeys(problems))


class _Reader:
    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._size = file, size
        self._records, self._bytes = 0, 0
        self._counts = dict.fromkeys(_LIMITS, 0)
        self._pictures: list[_Picture] = []
        self._drawn: dict[int, bool] = {}
        self._above: dict[int, set[int]] = {}

    def pictures(self) -> list[_Picture]:
        """Every record Texture and Video. ValueError: malformed; HeadError: too large."""
        header = self._read(_HEADER)
        if not header.startswith(_MAGIC):
            raise ValueError("the text form of FBX" if header[:1] == b";" else "no FBX")
        version = struct.unpack_from("<I", header, 23)[0]
        self._form = struct.Struct("<QQQB" if version >= _SINCE_64_BIT else "<IIIB")
        while self._record(self._size, 0, None):
            pass
        return self._pictures

    def is_drawn(self, picture: _Picture) -> bool:
        """Is it used for more than what :data:`_NOT_DRAWN` names? So it is where nothing is known of it."""
        # A video belongs to a texture, a texture to a property of a material.
        numbers = {picture.number, *self._above.get(picture.number, ())}
        uses = [self._drawn[number] for number in numbers if number in self._drawn]
        return not uses or any(uses)

    def _record(self, limit: int, depth: int, parent: _Picture | None) -> bool:
        """Walk a record that ends at limit or before; False for the empty one at the end of a list."""
        end, count, length, name_length = self._form.unpack(self._read(self._form.size))
        name = self._read(name_length)
        if end == 0:
            return False
        self._records += 1
        check_count(self._records, MAX_RECORDS, "records")
        start = self._file.tell()
        if depth > MAX_DEPTH or not start + length <= end <= limit or count > length:
            raise ValueError("a record does not lie where it should")
        if name in _LIMITS:
            self._counts[name] += 1
            check_count(self._counts[name], _LIMITS[name], f"records {name.decode()}")
        wanted = name in (b"Texture", b"Video", b"C") or (
            parent is not None and name in (*_NAMES, b"Content")
        )
        properties = list(self._properties(count, wanted))
        values = [value for value in properties if isinstance(value, bytes)]
        numbers = [value for value in properties if isinstance(value, int)]
        if self._file.tell() != start + length:
            raise ValueError("the properties of a record have another length than it says")
        picture = self._picture(name, values, numbers, parent)
        if self._file.tell() < end:
            while self._file.tell() < end and self._record(end, depth + 1, picture):
                pass
        if self._file.tell() != end:
            raise ValueError("a record has another length than it says")
        return True

    def _picture(
        self, name: bytes, values: list[bytes], numbers: list[int], parent: _Picture | None
    ) -> _Picture | None:
        """What the record's children belong to."""
        if name in (b"Texture", b"Video"):
            own = next((value.partition(b"\0\1")[0] for value in values if b"\0\1" in value), b"")
            number = numbers[0] if numbers else 0
            self._pictures.append(_Picture(own.decode("utf-8", "replace"), number))
            return self._pictures[-1]
        if name == b"C" and len(numbers) == 2:
            child, above = numbers
            if len(values) == 2:  # the kind of link, and the property of a material
                self._drawn[child] = self._drawn.get(child, False) or values[1] not in _NOT_DRAWN
            else:
                self._above.setdefault(child, set()).add(above)
        if parent is not None and values:
            if name == b"Content":
                parent.content = parent.content or values[0]
            elif name in _NAMES:
                if len(values[0]) > MAX_NAME:
                    raise ValueError("a file's name is too long")
                parent.names.setdefault(name, values[0].decode("utf-8", "replace"))
        return None

    def _properties(self, count: int, wanted: bool) -> Iterator[bytes | int]:
        """The text and binary properties of a record and its numbers of 64 bits, if they are wanted."""
        for _ in range(count):
            kind = self._read(1)
            if kind == b"L" and wanted:
                yield int.from_bytes(self._read(8), "little")
            elif kind in _PLAIN:
                self._skip(_PLAIN[kind])
            elif kind in _ARRAYS:
                number, encoding, stored = struct.unpack("<III", self._read(12))
                self._bytes += number * _ARRAYS[kind]
                check_count(self._bytes, MAX_GEOMETRY_BYTES, "bytes of geometry")
                self._array(number * _ARRAYS[kind], encoding, stored)
            elif kind in (b"S", b"R"):
                size = struct.unpack("<I", self._read(4))[0]
                if wanted:
                    yield self._read(size)
                else:
                    self._skip(size)
            else:
                raise ValueError("a property of an unknown kind")

    def _array(self, size: int, encoding: int, stored: int) -> None:
        """Does an array unpack to as many bytes as it says? The importer finds out when it has them."""
        if encoding == 0 and stored == size:
            self._skip(stored)
            return
        if encoding != 1:
            raise ValueError("an array in an unknown encoding")
        unpacker = zlib.decompressobj()
        while stored and size >= 0:
            piece = self._read(min(stored, _PIECE))
            stored -= len(piece)
            while piece and size >= 0:
                size -= len(unpacker.decompress(piece, _PIECE))
                piece = unpacker.unconsumed_tail
        if size:
            raise ValueError("an array unpacks to another length than it says")

    def _read(self, size: int) -> bytes:
        data = self._file.read(size)
        if len(data) < size:
            raise ValueError("cut off")
        return data

    def _skip(self, size: int) -> None:
        if self._file.seek(size, os.SEEK_CUR) > self._size:
            raise ValueError("cut off")
