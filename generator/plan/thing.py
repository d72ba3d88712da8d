# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's own thing that heads may wear: what the file beside its mesh says. stdlib only.

``NAME.json`` beside ``NAME.obj``, ``.ply`` or ``.glb``; its textures, too, have names that begin with NAME.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

from generator.errors import UsageError
from generator.escape import printable, quoted
from generator.labels import LABELS
from generator.reading import MAX_CONFIG_BYTES, parse_json, read_limited

SUFFIXES = (".obj", ".ply", ".glb")
"""Of meshes."""

MM_PER_UNIT = {"mm": 1.0, "cm": 10.0, "dm": 100.0, "m": 1000.0}

LANDMARKS = 468
"""Of Face Mesh."""

FEWEST = 3
MAX_POINTS = 468
MAX_MESH_BYTES = 1 << 28

FLAT = 0.02
"""Points nearer to one line than this share of their length do not say how a thing is turned."""

_KEYS = {"label", "points", "units", "opacity", "gloss"}


@dataclass(frozen=True)
class Attachment:
    """Where a thing is to be, and what it is.

    label: of :data:`generator.labels.LABELS`. points: (landmark, point of the mesh in its own units).
    units: of the mesh; None where the thing is scaled so that its points fit best.
    opacity, gloss: of all of its materials; None leaves them as they are.
    """

    label: str
    points: tuple[tuple[int, tuple[float, float, float]], ...]
    units: str | None = None
    opacity: float | None = None
    gloss: float | None = None


def read_attachment(mesh: Path) -> Attachment:
    """What is said of a mesh. Raises UsageError, which names the file and says what is wrong with it."""
    path = mesh.with_suffix(".json")
    try:
        said = parse_json(read_limited(path, MAX_CONFIG_BYTES))
        return _attachment(said)
    except FileNotFoundError as error:
        raise UsageError(
            printable(f"render.things: {mesh}: {path.name} is missing, which says where it is attached")
        ) from error
    except OSError as error:
        raise UsageError(printable(f"render.things: {path}: cannot be read ({error.strerror})")) from error
    except ValueError as error:
        raise UsageError(printable(f"render.things: {path}: {error}")) from error


def content(mesh: Path) -> bytes:
    """What decides a thing: the names and hashes of all files whose names begin with its own.

    Raises UsageError as :func:`read_attachment` does, and where a file cannot be read.
    """
    read_attachment(mesh)
    lines = []
    for path in sorted(mesh.parent.iterdir()):
        if path.name.startswith(mesh.stem) and path.is_file():
            try:
                found = hashlib.sha256(read_limited(path, MAX_MESH_BYTES)).hexdigest()
            except (OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or error
                raise UsageError(printable(f"render.things: {path}: cannot be read ({reason})")) from error
            lines.append(f"{path.name}\0{found}")
    return "\n".join(lines).encode("utf-8", "surrogateescape")


def _attachment(said: Any) -> Attachment:
    if not isinstance(said, dict):
        raise ValueError("expected an object with label and points")
    if unknown := sorted(set(said) - _KEYS):
        raise ValueError(f"no {shown(unknown[0])} is known; there are {', '.join(sorted(_KEYS))}")
    label = said.get("label")
    if label not in LABELS:
        raise ValueError(f"label is {shown(label)}; expected one of {', '.join(LABELS)}")
    units = said.get("units")
    if units is not None and units not in [*MM_PER_UNIT]:
        raise ValueError(f"units are {shown(units)}; expected one of {', '.join(MM_PER_UNIT)}, or none")
    points = said.get("points")
    if not isinstance(points, list) or not FEWEST <= len(points) <= MAX_POINTS:
        count = len(points) if isinstance(points, list) else "no"
        raise ValueError(f"{count} points; expected a list of {FEWEST} or more with landmark and point")
    found = tuple(_point(number, point) for number, point in enumerate(points, 1))
    if len({landmark for landmark, _ in found}) < len(found):
        raise ValueError("a landmark is named twice; give each once")
    if _on_a_line([place for _, place in found]):
        raise ValueError("its points lie on one line; add one beside it")
    return Attachment(label, found, units, _share(said, "opacity"), _share(said, "gloss"))


def _point(number: int, said: Any) -> tuple[int, tuple[float, float, float]]:
    if not isinstance(said, dict) or set(said) != {"landmark", "point"}:
        raise ValueError(f'point {number}: expected {{"landmark": NUMBER, "point": [x, y, z]}}')
    landmark, place = said["landmark"], said["point"]
    if type(landmark) is not int or not 0 <= landmark < LANDMARKS:
        raise ValueError(f"point {number}: no landmark {shown(landmark)}; there are 0 to {LANDMARKS - 1}")
    if not isinstance(place, list) or len(place) != 3 or not all(map(_is_number, place)):
        raise ValueError(f"point {number}: expected three numbers [x, y, z]")
    x, y, z = map(float, place)
    return landmark, (x, y, z)


def shown(value: Any) -> str:
    """A value of a stranger's, short enough for a message."""
    return quoted(str(value)[:40])


def _share(said: dict[str, Any], key: str) -> float | None:
    value = said.get(key)
    if value is None:
        return None
    if not _is_number(value) or not 0 <= value <= 1:
        raise ValueError(f"{key} is {shown(value)}; expected a number from 0 to 1")
    return float(value)


def _is_number(value: Any) -> bool:
    return type(value) in (int, float) and abs(value) < 1e12 and math.isfinite(value)


def _on_a_line(places: list[tuple[float, float, float]]) -> bool:
    """Are points on one line, or all in one place?"""
    first, second = max(combinations(places[:60], 2), key=lambda pair: math.dist(*pair))
    length = math.dist(first, second)
    if not length:
        return True
    along = [(b - a) / length for a, b in zip(first, second, strict=True)]

    def beside(place: tuple[float, float, float]) -> float:
        out = [p - a for p, a in zip(place, first, strict=True)]
        share = sum(o * d for o, d in zip(out, along, strict=True))
        return math.sqrt(sum((o - share * d) ** 2 for o, d in zip(out, along, strict=True)))

    return max(map(beside, places)) < FLAT * length
