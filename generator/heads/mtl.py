# SPDX-License-Identifier: GPL-3.0-or-later
"""Wavefront material files: base colour, opacity and two maps of each material.

Specular, bump and the rest are left out on purpose: the renderer owns light
and gloss, and files such as FaceScape's set them to values that spoil a face.
"""

from __future__ import annotations

import codecs
import contextlib
import math
import re
from dataclasses import dataclass
from pathlib import Path

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.encodings import local_text
from generator.heads.limits import MAX_MATERIALS, check_count, read_mesh_bytes
from generator.heads.paths import MissingFile, find_inside
from generator.heads.textures import IMAGE_SUFFIXES
from generator.heads.tiling import EXTEND, REPEAT

MAX_MTL_BYTES = 1 << 22
MAX_LIBRARIES = 32
"""Of the words behind all ``mtllib`` of an OBJ."""

_KEYWORD = b"mtllib"
_LIBRARY_LINE = re.compile(rb"mtllib[ \t]+((?:\\\r?\n|[^\r\n]){0,65536})")
_BEFORE_A_LINE = (b"\n", b"\r", codecs.BOM_UTF8)

_ONE_VALUE = ("-blendu", "-blendv", "-boost", "-cc", "-imfchan", "-texres", "-type", "-bm")
_OPTION_VALUES = {**dict.fromkeys(_ONE_VALUE, 1), "-mm": 2}


@dataclass
class MtlMaterial:
    """One ``newmtl``. Maps are names as written; scale and offset act on (u, v), and wrap is how the
    texture goes on beyond 0-1. ambient: the texture is that of map_Ka, as there is no map_Kd.
    transparency: Tr, which says the reverse of d. emissive: it has a map_Ke."""

    color: tuple[float, float, float] | None = None
    d: float | None = None
    transparency: float = 0.0
    texture: str | None = None
    ambient: bool = False
    opacity_map: str | None = None
    emissive: bool = False
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    wrap: str = REPEAT

    @property
    def opacity(self) -> float:
        """0-1: that of d, else what Tr leaves."""
        return 1.0 - self.transparency if self.d is None else self.d


def decode(data: bytes) -> str:
    """Text of an OBJ or MTL file: UTF-8 or another encoding, plain newlines, continued lines joined."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = local_text(data)
    return text.replace("\r\n", "\n").replace("\r", "\n").replace("\\\n", " ")


@dataclass(frozen=True)
class Libraries:
    """The MTL files of an OBJ, and what is wrong with those that it names, a line each."""

    files: tuple[Path, ...]
    missing: tuple[str, ...] = ()


def find_libraries(mesh_path: Path) -> Libraries:
    """The MTL files that an OBJ names with ``mtllib``, else ``head.mtl``, else ``head.obj.mtl``.

    A line may name several files, and there may be several lines, anywhere.

    Raises
    ------
    HeadError: ``mtllib`` names a file outside of the mesh's folder.
    OSError: the mesh cannot be read.
    """
    folder, missing = mesh_path.parent, []
    found: dict[Path, None] = {}
    for line in _library_lines(mesh_path):
        files, lacking = _files_of_line(folder, line)
        found |= dict.fromkeys(files)
        missing += lacking
    for name in (mesh_path.stem + ".mtl", mesh_path.name + ".mtl"):
        if found:
            break
        with contextlib.suppress(MissingFile):
            found[find_inside(folder, name, "material file")] = None
    return Libraries(tuple(found), tuple(dict.fromkeys(missing)))


def _library_lines(mesh_path: Path) -> list[str]:
    """What stands behind each ``mtllib`` of an OBJ, of which nothing else is looked at: listing a thousand
    heads must not parse a thousand meshes."""
    data = read_mesh_bytes(mesh_path)
    lines: dict[str, None] = {}
    at = data.find(_KEYWORD)
    while at >= 0:
        before = data[max(0, at - 16) : at].rstrip(b" \t")
        line = _LIBRARY_LINE.match(data, at) if before.endswith(_BEFORE_A_LINE) or not before else None
        if line:
            lines[decode(line[1]).strip()] = None
            words = sum(len(text.split()) for text in lines)
            check_count(words, MAX_LIBRARIES, "words that name material files")
        at = data.find(_KEYWORD, line.end() if line else at + len(_KEYWORD))
    lines.pop("", None)
    return list(lines)


def _files_of_line(folder: Path, line: str) -> tuple[list[Path], list[str]]:
    """The files that a line names, and what is wrong with those that are not there.

    A name may hold blanks: the whole line is one if there is such a file, else as many words as make one.
    """
    try:
        return [find_inside(folder, line, "material file")], []
    except MissingFile as error:
        missing = [str(error)]
    words, files, others = line.split(), [], []
    while words:
        for count in range(len(words), 0, -1):
            try:
                files.append(find_inside(folder, " ".join(words[:count]), "material file"))
                break
            except MissingFile as error:
                reason = str(error)
        else:
            others.append(reason)
        words = words[count:]
    return files, others if files else missing


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
                    current.d = _number(value.removeprefix("-halo"))
                case "tr":
                    current.transparency = _number(value)
                case "map_kd":
                    current.texture, current.scale, current.offset, current.wrap = _map(value)
                    current.ambient = False
                case "map_ka" if value and (current.ambient or not current.texture):
                    current.texture, current.scale, current.offset, current.wrap = _map(value)
                    current.ambient = True
                case "map_ke" if value:
                    current.emissive = True
                case "map_d":
                    current.opacity_map = _map(value)[0]
        except ValueError as error:
            raise HeadError(f"line {number} of {path} cannot be read: {quoted(line)}; correct it") from error
    return materials


def _number(value: str) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError("not finite")
    return number


def _color(value: str) -> tuple[float, float, float]:
    numbers = [float(x) for x in value.split()[:3]]
    if not all(map(math.isfinite, numbers)):
        raise ValueError("not finite")
    red, green, blue = (min(max(x, 0.0), 1.0) for x in (numbers * 3 if len(numbers) == 1 else numbers))
    return red, green, blue


def _map(value: str) -> tuple[str, tuple[float, float], tuple[float, float], str]:
    """File name (it may hold blanks), uv scale, offset and wrap of a texture statement."""
    wrap = REPEAT
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
        elif option == "-clamp":
            word, _, rest = rest.partition(" ")
            wrap, rest = EXTEND if word.lower() == "on" else REPEAT, rest.lstrip()
        elif option in _OPTION_VALUES:
            for _ in range(_OPTION_VALUES[option]):
                rest = rest.partition(" ")[2].lstrip()
        else:
            rest = f"{option} {rest}".rstrip()  # a file name that begins with a dash
            break
    if not rest or not all(map(math.isfinite, vectors["-s"] + vectors["-o"])):
        raise ValueError("no file name")
    return rest, (vectors["-s"][0], vectors["-s"][1]), (vectors["-o"][0], vectors["-o"][1]), wrap


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
