# SPDX-License-Identifier: GPL-3.0-or-later
"""Wavefront material files: base colour, opacity and two maps of each material.

Specular, bump and the rest are left out on purpose: the renderer owns light
and gloss, and files such as FaceScape's set them to values that spoil a face.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.limits import MAX_MATERIALS, check_count, check_mesh_file, read_mesh_bytes
from generator.heads.paths import MissingFile, find_inside
from generator.heads.textures import IMAGE_SUFFIXES

HEADER_BYTES = 1 << 16
"""``mtllib`` is looked for in this much of an OBJ file: exporters write it first,
and listing a thousand heads must not read a thousand meshes."""

MAX_MTL_BYTES = 1 << 22

_ONE_VALUE = ("-blendu", "-blendv", "-boost", "-cc", "-clamp", "-imfchan", "-texres", "-type", "-bm")
_OPTION_VALUES = {**dict.fromkeys(_ONE_VALUE, 1), "-mm": 2}


@dataclass
class MtlMaterial:
    """One ``newmtl``. Maps are names as written; scale and offset act on (u, v)."""

    color: tuple[float, float, float] | None = None
    opacity: float = 1.0
    texture: str | None = None
    opacity_map: str | None = None
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)


def decode(data: bytes) -> str:
    """Text of an OBJ or MTL file: UTF-8, else Latin-1, with plain newlines and continued lines joined."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " ")


def find_library(mesh_path: Path) -> Path | None:
    """The MTL file of an OBJ: by ``mtllib``, else ``head.mtl``, else ``head.obj.mtl``; None without one.

    Raises
    ------
    HeadError: ``mtllib`` names a file outside of the mesh's folder.
    """
    check_mesh_file(mesh_path)
    with mesh_path.open("rb") as file:
        header = decode(file.read(HEADER_BYTES))
    lines = [line.split(None, 1) for line in header.split("\n")]
    wanted = dict.fromkeys(line[1].strip() for line in lines if len(line) == 2 and line[0] == "mtllib")
    for name in [*wanted, mesh_path.stem + ".mtl", mesh_path.name + ".mtl"]:
        try:
            return find_inside(mesh_path.parent, name, "material file")
        except MissingFile:
            continue
    return None


def find_stem_texture(mesh_path: Path) -> Path | None:
    """The image with the mesh's own name, for meshes without a material file."""
    for suffix in IMAGE_SUFFIXES:
        try:
            return find_inside(mesh_path.parent, mesh_path.stem + suffix, "texture")
        except MissingFile:
            continue
    return None


def read_mtl(path: Path) -> dict[str, MtlMaterial]:
    """Materials by name.

    Raises
    ------
    HeadError: the file is too big, holds too many materials, or a number in it is not one.
    """
    materials: dict[str, MtlMaterial] = {}
    current = MtlMaterial()
    for number, line in enumerate(decode(read_mesh_bytes(path, MAX_MTL_BYTES)).split("\n"), 1):
        key, _, value = line.strip().replace("\t", " ").partition(" ")
        value = value.strip()
        try:
            match key.lower():
                case "newmtl":
                    current = materials.setdefault(value, MtlMaterial())
                    check_count(len(materials), MAX_MATERIALS, f"materials in {path.name}")
                case "kd" if value[:1].isdigit() or value[:1] in ".-+":
                    current.color = _color(value)
                case "d":
                    current.opacity = float(value.removeprefix("-halo").strip())
                case "map_kd":
                    current.texture, current.scale, current.offset = _map(value)
                case "map_d":
                    current.opacity_map, _, _ = _map(value)
        except ValueError as error:
            raise HeadError(f"line {number} of {path} cannot be read: {quoted(line)}; correct it") from error
    return materials


def _color(value: str) -> tuple[float, float, float]:
    numbers = [float(x) for x in value.split()[:3]]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("not finite")
    red, green, blue = (min(max(x, 0.0), 1.0) for x in (numbers * 3 if len(numbers) == 1 else numbers))
    return red, green, blue


def _map(value: str) -> tuple[str, tuple[float, float], tuple[float, float]]:
    """File name (it may hold blanks), uv scale and offset of a texture statement."""
    vectors = {"-s": [1.0, 1.0], "-o": [0.0, 0.0], "-t": [0.0, 0.0]}
    rest = value
    while rest.startswith("-"):
        option, _, rest = rest.partition(" ")
        rest = rest.lstrip()
        if option in vectors:
            for i in range(3):
                word, _, after = rest.partition(" ")
                if not after or not _is_number(word):
                    break
                if i < 2:
                    vectors[option][i] = float(word)
                rest = after.lstrip()
        elif option in _OPTION_VALUES:
            for _ in range(_OPTION_VALUES[option]):
                rest = rest.partition(" ")[2].lstrip()
        else:
            rest = f"{option} {rest}".rstrip()  # a file name that begins with a dash
            break
    if not rest or not all(map(math.isfinite, vectors["-s"] + vectors["-o"])):
        raise ValueError("no file name")
    return rest, (vectors["-s"][0], vectors["-s"][1]), (vectors["-o"][0], vectors["-o"][1])


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
