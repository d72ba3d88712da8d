# SPDX-License-Identifier: GPL-3.0-or-later
"""FaceScape as a real download lies on disk (Yang et al., CVPR 2020; Zhu et al., TPAMI 2023).

A subject is a folder with a number for a name that holds ``models_reg``, or
the meshes themselves, at any depth. Its identity here is "facescape-<id>":
a string that no table reader takes for a number, and that does not clash with
subject 122 of another source. ``dpmap`` and the material files are not used:
the texture is the image with the mesh's name, and the MTL (``Kd 0 0 0``,
``Ks 1``) is only asked when there is none.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from generator.errors import HeadError
from generator.escape import printable
from generator.heads.head import Finder, Head, SkippedHead
from generator.heads.mtl import read_mtl
from generator.heads.paths import find_inside

EXPRESSIONS = (
    "neutral", "smile", "mouth_stretch", "anger", "jaw_left", "jaw_right", "jaw_forward",
    "mouth_left", "mouth_right", "dimpler", "chin_raiser", "lip_puckerer", "lip_funneler",
    "sadness", "lip_roll", "grin", "cheek_blowing", "eye_closed", "brow_raiser", "brow_lower",
)  # fmt: skip
"""Expression k of the data set is EXPRESSIONS[k - 1]."""

LICENSE = "LicenseRef-FaceScape"
ATTRIBUTION = "FaceScape, Nanjing University: non-commercial research only, no redistribution"
OF_PUBLISHABLE = f"{ATTRIBUTION} but of rendered portraits of this subject"

PUBLISHABLE_IDS = frozenset({122, 212, 340, 344, 393, 395, 421, 527, 594, 610})
"""Subjects whose rendered portraits may be published (publishable_list_v1.txt)."""

FIRST_MOSAICKED_ID = 360
"""From here on the eyes in the texture are mosaicked."""

MAX_DEPTH = 5
_MESH = re.compile(r"^(\d+)_(.+)\.obj$", re.IGNORECASE)
_IMAGE_SUFFIXES = (".jpg", ".jpeg", ".png")


def find_facescape(path: Path) -> tuple[list[Head], list[SkippedHead]]:
    """The heads under ``path``, by id and expression number; empty if it is not FaceScape.

    Only folders are listed and nothing is parsed: all 847 subjects take seconds.
    """
    heads: list[Head] = []
    skipped: list[SkippedHead] = []
    seen: dict[tuple[str, str], Path] = {}
    if path.is_file():
        number = _subject_number(path.parent)
        folders = [(number, path.parent)] if number is not None and _expression(path.name) else []
    else:
        folders = sorted(_subject_folders(path), key=lambda found: (found[0], str(found[1])))
    for number, folder in folders:
        with os.scandir(folder) as entries:
            names = {entry.name for entry in entries if not entry.is_dir()}
        for name in [path.name] if path.is_file() else _meshes(names):
            found = _head(number, folder, name, names)
            first = seen.setdefault((found.subject, found.expression), folder)
            if first != folder:
                reason = f"also in {first}"
                skipped.append(SkippedHead(found.subject, found.expression, folder / name, reason))
            elif isinstance(found, Head):
                heads.append(found)
            else:
                skipped.append(found)
    return heads, skipped


def expression_number(expression: str) -> int | None:
    """1 to 20 of a FaceScape expression, None for any other name."""
    return EXPRESSIONS.index(expression) + 1 if expression in EXPRESSIONS else None


def _subject_folders(path: Path) -> Iterator[tuple[int, Path]]:
    """(id, folder with the meshes) below path, path itself included."""
    number = _subject_number(path)
    if number is not None and _has_meshes(path):
        yield number, path
        return
    stack = [(path, 0)]
    while stack:
        folder, depth = stack.pop()
        try:
            with os.scandir(folder) as found:
                entries = [Path(e.path) for e in found if e.is_dir() and not e.name.startswith(".")]
        except OSError:
            # A folder that may not be listed holds no heads for this user.
            continue
        for entry in entries:
            number = _subject_number(entry)
            if number is not None and entry.name != "models_reg" and (entry / "models_reg").is_dir():
                yield number, entry / "models_reg"
            elif number is not None and _has_meshes(entry):
                yield number, entry
            elif depth + 1 < MAX_DEPTH and entry.name != "dpmap":
                stack.append((entry, depth + 1))


def _subject_number(folder: Path) -> int | None:
    """The id a folder stands for: its own name, or its parent's for ``models_reg``."""
    name = folder.parent.name if folder.name == "models_reg" else folder.name
    return int(name) if name.isascii() and name.isdecimal() and len(name) <= 4 else None


def _has_meshes(folder: Path) -> bool:
    return any(_expression(entry.name) for entry in folder.iterdir())


def _expression(file_name: str) -> str | None:
    """ "smile" of "2_smile.obj"; None if number and name do not belong together."""
    match = _MESH.match(file_name)
    name = match[2].lower() if match else ""
    return name if match and str(expression_number(name)) == match[1] else None


def _meshes(names: set[str]) -> list[str]:
    """The OBJ files of a subject in order, also those of which only the texture is there."""
    objs = {name for name in names if _MESH.match(name)}
    for name in names:
        mesh = Path(name).stem + ".obj"
        if Path(name).suffix.lower() in _IMAGE_SUFFIXES and _expression(mesh):
            objs.add(mesh)
    return sorted(objs, key=lambda name: (int(name.split("_")[0]), name))


def _head(number: int, folder: Path, name: str, names: set[str]) -> Head | SkippedHead:
    subject, mesh_path = f"facescape-{number}", folder / name
    expression = _expression(name)
    if expression is None:
        return SkippedHead(
            subject, printable(mesh_path.stem), mesh_path, "not one of FaceScape's 20 expressions"
        )
    if name not in names:
        return SkippedHead(subject, expression, mesh_path, f"the mesh {name} is missing")
    if not mesh_path.is_file():
        return SkippedHead(subject, expression, mesh_path, f"the mesh {name} is not a file")
    images = [mesh_path.stem + suffix for suffix in _IMAGE_SUFFIXES]
    texture = next((folder / image for image in images if image in names), None)
    if texture is None:
        try:
            texture = _texture_of_mtl(folder, name, names)
        except HeadError as error:
            return SkippedHead(subject, expression, mesh_path, printable(str(error)))
    problems = []
    if number >= FIRST_MOSAICKED_ID:
        problems.append("mosaicked eyes in the texture; expect weaker landmarks")
    return Head(
        subject=subject,
        expression=expression,
        source="facescape",
        mesh_path=mesh_path,
        files=(mesh_path, texture),
        license=LICENSE,
        redistributable=number in PUBLISHABLE_IDS,
        attribution=OF_PUBLISHABLE if number in PUBLISHABLE_IDS else ATTRIBUTION,
        units="mm",
        up="+Y",
        forward="+Z",
        problems=tuple(problems),
    )


def _texture_of_mtl(folder: Path, name: str, names: set[str]) -> Path:
    """The image the MTL names, for copies that keep one texture a subject."""
    stem = Path(name).stem
    for library in (name + ".mtl", stem + ".mtl"):
        if library in names:
            maps = [m.texture for m in read_mtl(folder / library).values() if m.texture]
            if maps:
                return find_inside(folder, maps[0], "texture")
    raise HeadError(f"the texture {stem}.jpg is missing")


FINDER = Finder(find_facescape, LICENSE)
