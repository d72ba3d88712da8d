# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads as plain mesh files, in one folder or in a folder a subject."""

from __future__ import annotations

import os
from collections import Counter
from pathlib import Path

from generator.errors import HeadError
from generator.escape import printable
from generator.heads import usd
from generator.heads.card import CARD_NAME, HeadCard, read_card
from generator.heads.collada import collada_files
from generator.heads.fbx import check_fbx
from generator.heads.gltf_file import gltf_files
from generator.heads.head import NEUTRAL, SCENE_SUFFIX, Finder, Head, SkippedHead
from generator.heads.obj import obj_files
from generator.heads.paths import check_name, find_inside, natural_key
from generator.heads.ply import ply_textures

SUFFIXES = (".obj", ".ply", ".glb", ".gltf", ".vrm", ".fbx", ".dae", *usd.SUFFIXES, ".stl")
"""Where one head comes in several formats, the first of these is read."""

UNREAD = {
    **dict.fromkeys((SCENE_SUFFIX, ".abc", ".x3d"), "in Blender"),
    **dict.fromkeys((".3ds", ".wrl", ".max", ".ma", ".mb", ".c4d"), "in the program that wrote it"),
}
"""Other formats of meshes, and where such a file is opened. Some name further files, anywhere: Blender, whose
importers could read them, would open what they name."""

ARCHIVES = (".zip", ".7z", ".rar", ".gz", ".tgz", ".tar")
"""Which heads have to be unpacked from: what is hashed, placed and rendered again are files."""

MAX_DEPTH = 3


UNKNOWN_LICENSE = "licence unknown"


class _Found:
    """Heads so far, and the reasons for those that are none."""

    def __init__(self) -> None:
        self.heads: dict[tuple[str, str], Head] = {}
        self.skipped: list[SkippedHead] = []

    def skip(self, subject: str, expression: str, path: Path, reason: str) -> None:
        self.skipped.append(SkippedHead(printable(subject), printable(expression), path, printable(reason)))

    def add(self, subject: str, expression: str, mesh: Path, card: HeadCard) -> None:
        try:
            head = _head(subject, expression, mesh, card)
            first = self.heads.setdefault((subject, expression), head)
            if first is not head:
                raise HeadError(f"the same subject and expression as {first.mesh_path}")
        except HeadError as error:
            self.skip(subject, expression, mesh, str(error))
        except OSError as error:
            self.skip(subject, expression, mesh, f"{mesh} cannot be read: {error.strerror}")


def find_meshes(path: Path) -> tuple[list[Head], list[SkippedHead]]:
    """The heads under ``path``: a mesh file, a folder of them, or folders of subjects.

    A ``head.json`` in a folder is trusted. Without one, the subject is the
    folder's name and the expression the file's, "neutral" if there is one mesh;
    meshes that lie in ``path`` itself, several and without head.json, are a
    subject each. Folders that share a name are told apart by their parents'.

    Raises
    ------
    HeadError: ``path`` cannot be listed.
    """
    found = _Found()
    plain = HeadCard(expressions={})
    if path.is_file():
        if path.suffix.lower() in SUFFIXES:
            found.add(path.stem, NEUTRAL, path, plain)
        elif path.suffix.lower() in UNREAD:
            found.skip(path.stem, NEUTRAL, path, _unread(path.name))
        return list(found.heads.values()), found.skipped
    folders = _mesh_folders(path)
    common = Counter(folder.name for folder, _ in folders)
    for folder, names in folders:
        subject = folder.name
        if common[subject] > 1 and folder != path:
            subject = "-".join(folder.relative_to(path).parts)
        if CARD_NAME in names:
            _add_card(found, subject, folder)
            continue
        meshes = [name for name in names if Path(name).suffix.lower() in SUFFIXES]
        stems = {Path(name).stem for name in meshes}
        for name in sorted(names, key=natural_key):
            if Path(name).suffix.lower() in UNREAD and Path(name).stem not in stems:
                found.skip(
                    Path(name).stem if folder == path else subject, NEUTRAL, folder / name, _unread(name)
                )
        for name in sorted(meshes, key=_by_stem_then_format):
            stem = Path(name).stem
            if len(stems) == 1:
                found.add(subject, NEUTRAL, folder / name, plain)
            elif folder == path:
                found.add(stem, NEUTRAL, folder / name, plain)
            else:
                found.add(subject, stem, folder / name, plain)
        for name in sorted(names, key=natural_key):
            # One that was unpacked lies beside its files.
            if Path(name).suffix.lower() in ARCHIVES and not _is_unpacked(folder, Path(name).stem, stems):
                found.skip(Path(name).stem, NEUTRAL, folder / name, f"{name} is an archive; unpack it here")
    return list(found.heads.values()), found.skipped


def _is_unpacked(folder: Path, stem: str, stems: set[str]) -> bool:
    plain = stem.removesuffix(".tar")
    return plain in stems or Path(plain).stem in stems or (folder / plain).is_dir()


def _unread(name: str) -> str:
    suffix = Path(name).suffix.lower()
    if suffix == SCENE_SUFFIX:
        return f"{name} is a scene, and a source of its own: headturn build {name}"
    return f"{suffix[1:].upper()} is not read; open the file {UNREAD[suffix]} and export it as GLB"


def _by_stem_then_format(name: str) -> tuple[object, ...]:
    stem, suffix = Path(name).stem, Path(name).suffix.lower()
    return natural_key(stem), stem, SUFFIXES.index(suffix), name


def _mesh_folders(path: Path) -> list[tuple[Path, list[str]]]:
    """(folder, its file names) with meshes or a head.json, in natural order of their paths."""
    found = []
    stack = [(path, 0)]
    while stack:
        folder, depth = stack.pop()
        try:
            with os.scandir(folder) as listing:
                entries = list(listing)
        except OSError as error:
            if folder == path:
                raise HeadError(f"{folder} cannot be listed: {error.strerror}") from error
            # A folder that may not be listed holds no heads for this user.
            continue
        entries = [entry for entry in entries if not entry.name.startswith(".")]
        names = [entry.name for entry in entries if not entry.is_dir()]
        if CARD_NAME in names or any(Path(name).suffix.lower() in (*SUFFIXES, *UNREAD) for name in names):
            found.append((folder, names))
        if depth < MAX_DEPTH and CARD_NAME not in names:
            stack += [(Path(entry.path), depth + 1) for entry in entries if entry.is_dir()]
    return sorted(found, key=lambda item: tuple(map(natural_key, item[0].parts)))


def _add_card(found: _Found, subject: str, folder: Path) -> None:
    path = folder / CARD_NAME
    try:
        card = read_card(path)
    except HeadError as error:
        found.skip(subject, NEUTRAL, path, str(error))
        return
    subject = card.subject or subject
    for expression, name in card.files().items():
        try:
            mesh = find_inside(folder, name, "mesh")
        except HeadError as error:
            found.skip(subject, expression, path, str(error))
            continue
        found.add(subject, expression, mesh, card)


def _head(subject: str, expression: str, mesh: Path, card: HeadCard) -> Head:
    check_name(subject, "subject")
    check_name(expression, "expression")
    if mesh.suffix.lower() not in SUFFIXES:
        raise HeadError(f"{mesh.name} is not one of {', '.join(SUFFIXES)}")
    if not mesh.is_file():
        raise HeadError(f"{mesh} is not a file")
    textures, problems = _textures(mesh)
    if card.license == "unknown":
        problems = (*problems, UNKNOWN_LICENSE)
    return Head(
        subject=subject,
        expression=expression,
        source=card.source,
        mesh_path=mesh,
        files=(mesh, *textures),
        license=card.license,
        redistributable=card.redistributable,
        attribution=card.attribution,
        units=card.units,
        up=card.up,
        forward=card.forward,
        problems=problems,
    )


def _textures(mesh: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """Materials and images a mesh will be drawn with, and what is missing, without parsing it."""
    match mesh.suffix.lower():
        case ".obj":
            return obj_files(mesh)
        case ".ply":
            return ply_textures(mesh), ()
        case ".gltf":
            return gltf_files(mesh), ()
        case suffix if suffix in usd.SUFFIXES:
            usd.check_usd(mesh)  # its images are known once Blender has read it
        case ".dae":
            return collada_files(mesh)
        case ".fbx":
            # Blender reads its textures; what they are stands in no unit's name.
            return (), check_fbx(mesh)
    return (), ()


FINDER = Finder(find_meshes)
