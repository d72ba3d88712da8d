# SPDX-License-Identifier: GPL-3.0-or-later
"""The lines of an OBJ as arrays.

Runs of lines that look alike, which is nearly all of a mesh, are read at once: a scan
of millions of triangles would else be tens of millions of small Python objects.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import groupby

import numpy as np

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.limits import MAX_MATERIALS, check_count

MAX_INDEX = 2**31 - 1
_BLOCK = 1 << 22
"""Characters that are split into lines at a time."""

_RUNS, _SHARED = 12, 1 << 20
"""Heads of one topology have the same faces and texture coordinates, letter by letter: so many runs of lines,
of fewer characters, are read once for all of them."""

_POINTS = {
    key: {width: re.compile(rf"(?:{key.strip()}(?: +[-+.0-9eE]+){{{width}}} *\n)+") for width in widths}
    for key, widths in (("v ", (3, 6)), ("vt", (2, 3)))
}
"""Lines of so many numbers."""

_INDEX = r"[0-9]{1,9}"
_CORNERS = {
    rf"{_INDEX}/{_INDEX}/{_INDEX}": (3, 1),
    rf"{_INDEX}/{_INDEX}": (2, 1),
    rf"{_INDEX}//{_INDEX}": (2, None),
    _INDEX: (1, None),
}
"""How corners are written: how many numbers each has, and which is the texture coordinate's."""


@dataclass(frozen=True)
class _Form:
    """A way to write faces. corners: of each; width, uv: as in _CORNERS."""

    pattern: re.Pattern[str]
    corners: int
    width: int
    uv: int | None


_FACES = [
    _Form(re.compile(rf"(?:f(?: {corner}){{{count}}} ?\n)+"), count, *numbers)
    for corner, numbers in _CORNERS.items()
    for count in (3, 4)
]


@dataclass
class ObjLines:
    """What the lines of a file say, one after the other.

    positions: x, y, z of each vertex. colors: as many, empty if a vertex has none. uvs: u, v.
    corner_position, corner_uv: from 1 on, of each corner of each face; 0 where it has no uv.
    face_corners, face_material: of each face. materials: names and numbers in order of appearance.
    """

    positions: array[float] = field(default_factory=lambda: array("d"))
    colors: array[float] = field(default_factory=lambda: array("d"))
    uvs: array[float] = field(default_factory=lambda: array("d"))
    corner_position: array[int] = field(default_factory=lambda: array("i"))
    corner_uv: array[int] = field(default_factory=lambda: array("i"))
    face_corners: array[int] = field(default_factory=lambda: array("i"))
    face_material: array[int] = field(default_factory=lambda: array("i"))
    materials: dict[str, int] = field(default_factory=dict)

    def table(self, values: array[float], width: int) -> np.ndarray:
        """float64 [N, width] of positions, colors or uvs, which must not grow any more."""
        return np.frombuffer(values, dtype=np.float64).reshape(-1, width)


def parse_lines(text: str) -> ObjLines:
    """The lines of an OBJ, whose newlines are plain and whose continued lines are joined.

    Raises
    ------
    HeadError: a line cannot be read, or there are too many materials.
    """
    return _Parser().parse(text)


def _points(key: str, run: str) -> np.ndarray | None:
    """float64 [N, width] of lines that all begin with key and have as many numbers; None if they do not."""
    width = next((width for width, pattern in _POINTS.get(key, {}).items() if pattern.fullmatch(run)), 0)
    if not width:
        return None
    numbers = run.replace(key.strip(), " ").split()
    try:
        return np.fromiter(map(float, numbers), np.float64, len(numbers)).reshape(-1, width)
    except ValueError:
        return None


@lru_cache(maxsize=_RUNS)
def _uvs(run: str) -> bytes | None:
    """Texture coordinates, float64 u, v, of lines that look alike."""
    values = _points("vt", run)
    return None if values is None else values[:, :2].tobytes()


@lru_cache(maxsize=_RUNS)
def _corners(run: str) -> tuple[int, bytes, bytes] | None:
    """Of faces that look alike: corners each, and int32 vertex and texture coordinate of every corner."""
    form = next((form for form in _FACES if form.pattern.fullmatch(run)), None)
    if form is None:
        return None
    numbers = run.replace("f", " ").replace("/", " ").split()
    values = np.fromiter(map(int, numbers), np.int32, len(numbers)).reshape(-1, form.width)
    if not values[:, [0] if form.uv is None else [0, form.uv]].all():
        return None  # whose line is to be named
    uv = np.zeros(len(values), np.int32) if form.uv is None else values[:, form.uv]
    return form.corners, values[:, 0].tobytes(), uv.tobytes()


class _Parser:
    def __init__(self) -> None:
        self._obj = ObjLines()
        self._material = -1

    def parse(self, text: str) -> ObjLines:
        number = 1
        for lines in _blocks(text):
            for key, run in groupby(lines, key=_key):
                rows = list(run)
                if not self._run(key, rows):
                    for place, line in enumerate(rows):
                        self._line(line, number + place)
                number += len(rows)
        return self._obj

    def _run(self, key: str, rows: list[str]) -> bool:
        """Read lines of one kind at once; False if one of them is special."""
        if key == "vn":
            return True
        if key == "f ":
            return self._faces(rows)
        run = "\n".join(rows) + "\n"
        if key == "vt":
            uvs = _uvs(run) if len(run) < _SHARED else _uvs.__wrapped__(run)
            if uvs is not None:
                self._obj.uvs.frombytes(uvs)
            return uvs is not None
        values = _points(key, run)
        if values is not None:
            self._add_vertices(values)
        return values is not None

    def _add_vertices(self, values: np.ndarray) -> None:
        """float64 [N, 3 or more]: coordinates, then a colour if all vertices have one."""
        obj = self._obj
        colored = len(obj.colors) == len(obj.positions) and values.shape[1] >= 6
        if colored:
            obj.colors.frombytes(np.ascontiguousarray(values[:, 3:6]).tobytes())
        else:
            del obj.colors[:]
        obj.positions.frombytes(np.ascontiguousarray(values[:, :3]).tobytes())

    def _faces(self, rows: list[str]) -> bool:
        run = "\n".join(rows) + "\n"
        read = _corners(run) if len(run) < _SHARED else _corners.__wrapped__(run)
        if read is None:
            return False
        count, position, uv = read
        self._begin_faces()
        obj = self._obj
        obj.corner_position.frombytes(position)
        obj.corner_uv.frombytes(uv)
        obj.face_corners.extend([count] * len(rows))
        obj.face_material.extend([self._material] * len(rows))
        return True

    def _begin_faces(self) -> None:
        if self._material < 0:
            self._material = self._obj.materials.setdefault("", len(self._obj.materials))

    def _line(self, line: str, number: int) -> None:
        words = line.split()
        match words[:1]:
            case ["v"]:
                self._vertex(words[1:])
            case ["vt"]:
                self._uv(words[1:])
            case ["f"]:
                try:
                    self._face(words[1:])
                except ValueError as error:
                    raise HeadError(
                        f"line {number} cannot be read: {quoted(line)}; export the mesh again"
                    ) from error
            case ["usemtl"]:
                name = line.strip()[6:].strip()
                self._material = self._obj.materials.setdefault(name, len(self._obj.materials))
                check_count(len(self._obj.materials), MAX_MATERIALS, "materials")

    def _vertex(self, words: list[str]) -> None:
        try:
            values = np.array([[float(word) for word in words[: 6 if len(words) >= 6 else 3]]])
        except ValueError as error:
            raise HeadError("a vertex line is not made of three numbers; export the mesh again") from error
        if len(words) < 3:
            raise HeadError("a vertex line is not made of three numbers; export the mesh again")
        self._add_vertices(values)

    def _uv(self, words: list[str]) -> None:
        try:
            # v may be left out.
            self._obj.uvs.extend([float(word) for word in [*words, "0", "0"][:2]])
        except ValueError as error:
            raise HeadError(
                f"a texture coordinate is not a number ({error}); export the mesh again"
            ) from error

    def _face(self, words: list[str]) -> None:
        if len(words) < 3:
            raise ValueError("a face needs three corners")
        self._begin_faces()
        obj = self._obj
        for word in words:
            parts = word.split("/")
            obj.corner_position.append(_index(parts[0], len(obj.positions) // 3))
            named = len(parts) > 1 and parts[1]
            obj.corner_uv.append(_index(parts[1], len(obj.uvs) // 2) if named else 0)
        obj.face_corners.append(len(words))
        obj.face_material.append(self._material)


def _key(line: str) -> str:
    return line[:2]


def _blocks(text: str) -> Iterator[list[str]]:
    start = 0
    while start <= len(text):
        end = text.find("\n", start + _BLOCK)
        end = len(text) if end < 0 else end
        yield text[start:end].split("\n")
        start = end + 1


def _index(word: str, count: int) -> int:
    """From 1 on; a negative one counts back from the last element so far. ValueError: it points nowhere."""
    index = int(word)
    if 0 < index <= MAX_INDEX:
        return index
    if not -count <= index < 0:
        raise ValueError("an index points nowhere")
    return index + count + 1
