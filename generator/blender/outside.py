# SPDX-License-Identifier: GPL-3.0-or-later
"""Files outside of a .blend that its pictures may depend on: textures, libraries, caches, volumes, fonts."""

from __future__ import annotations

import os
import re
from collections.abc import Collection, Iterator
from dataclasses import dataclass

import bpy

from generator.blender.scene_file import listed

MOST = 10_000
"""Files that are told one by one: an image or a simulation may have one a frame."""

_TILE = re.compile("<UDIM>|<UVTILE>")
"""What stands in a path for the number of a tile."""

_FRAME = re.compile(r"\d+(?=\D*$)")
"""The number of a file of a sequence is the last of its name."""


@dataclass(frozen=True)
class Outside:
    """files: full paths of those that are there. problems: what cannot be had or told, a line each."""

    files: tuple[str, ...]
    problems: tuple[str, ...]


def outside() -> Outside:
    """What the open .blend names, every file of a sequence, of tiles and of a cache.

    To be asked last: sounds, films, texts and the sequencer, which no picture shows, are taken out of it.
    """
    for scene in bpy.data.scenes:
        scene.sequence_editor_clear()
    bpy.data.batch_remove([*bpy.data.texts, *bpy.data.sounds, *bpy.data.movieclips])
    series = {_full(one) for one in _sequences()}
    found: set[str] = set()
    missing: set[str] = set()
    # Without what is packed, and with what libraries name. Where physics are kept, no data say.
    paths = bpy.utils.blend_paths(absolute=True, packed=False, local=False)
    kept = os.path.splitext(bpy.data.filepath)[0]
    kept = os.path.join(os.path.dirname(kept), f"blendcache_{os.path.basename(kept)}")
    for path in map(os.path.normpath, [*paths, *filter(os.path.isdir, [kept])]):
        is_folder = os.path.isdir(path)
        meant = _inside(path) if is_folder else _series(path, path in series)
        there = [file for file in meant if os.path.isfile(file) and os.access(file, os.R_OK)]
        found.update(there)
        if not there and not is_folder:
            missing.add(path)
    problems = [*_missing(missing)]
    if len(found) > MOST:
        problems.append(
            f"{len(found):,} files outside of the .blend are too many to be told: their bytes stand in no "
            "unit's name, and no replay knows whether one was changed"
        )
        found.clear()
    return Outside(tuple(sorted(found)), tuple(problems))


def _missing(missing: Collection[str]) -> Iterator[str]:
    """What is not there, by what it is."""
    libraries = [one for one in bpy.data.libraries if _full(one) in missing]
    images = [
        one for one in bpy.data.images if one.filepath and not one.packed_files and _full(one) in missing
    ]
    others = {*missing} - {_full(one) for one in (*libraries, *images)}
    if libraries:
        yield f"{listed(one.filepath for one in libraries)}: a linked library is missing"
    if images:
        yield f"{listed(one.name for one in images)}: a texture is missing, and rendered in magenta"
    if others:
        yield f"{listed(sorted(others))}: missing, and rendered without"


def _sequences() -> Iterator[bpy.types.ID]:
    """What is one file a frame."""
    yield from (one for one in bpy.data.images if one.source == "SEQUENCE")
    yield from (one for one in (*bpy.data.volumes, *bpy.data.cache_files) if one.is_sequence)


def _full(one: bpy.types.ID) -> str:
    return os.path.normpath(bpy.path.abspath(one.filepath, library=one.library))


def _series(path: str, is_sequence: bool) -> list[str]:
    """The files that one path means."""
    folder, name = os.path.split(path)
    number = _FRAME.search(name) if is_sequence else _TILE.search(name)
    if number is None:
        return [path]
    numbers = r"u\d+_v\d+" if number.group() == "<UVTILE>" else r"\d+"
    pattern = re.compile(re.escape(name[: number.start()]) + numbers + re.escape(name[number.end() :]))
    names = os.listdir(folder) if os.path.isdir(folder) else []
    return [os.path.join(folder, one) for one in names if pattern.fullmatch(one)]


def _inside(folder: str) -> list[str]:
    """The files of a cache."""
    return [os.path.join(below, name) for below, _, names in os.walk(folder) for name in names]
