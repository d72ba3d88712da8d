# SPDX-License-Identifier: GPL-3.0-or-later
"""USD in all its forms: the layer is read by Blender, which sees no other file; its images are read here."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.archives import unpack_stored
from generator.heads.gltf import read_gltf
from generator.heads.limits import MAX_GEOMETRY_BYTES, read_mesh_bytes
from generator.heads.mesh import HeadMesh
from generator.heads.paths import find_below
from generator.heads.textures import IMAGE_SUFFIXES
from generator.reading import check_regular, parse_json

SUFFIXES = (".usd", ".usda", ".usdc", ".usdz")
_LAYERS = {b"#usda": ".usda", b"PXR-USDC": ".usdc"}
_PACKAGE = b"PK\3\4"


def check_usd(path: Path) -> None:
    """Raises HeadError: neither a layer nor a package of USD, or larger than a head. OSError: it cannot be
    read."""
    try:
        check_regular(path, MAX_GEOMETRY_BYTES)
    except ValueError as error:
        raise HeadError(f"{path.name} {error}; make it smaller") from error
    if not _start(path).startswith((*_LAYERS, _PACKAGE)):
        raise HeadError("not a USD file; export it again, or as GLB")


def read_usd(path: Path, scratch: Path, import_with_blender: Callable[[Path, Path], Path] | None) -> HeadMesh:
    """What Blender makes of a USD layer, or of the first one of a package, in metres, +Y up.

    Raises
    ------
    HeadError: no Blender that reads USD, a layer that is put together from others, more than a head may
        have, or a texture that is missing, outside of the folder or not an image.
    """
    if import_with_blender is None:
        raise HeadError("USD is read by Blender, which is not available here; convert it to GLB")
    check_usd(path)
    own = scratch / "usd"
    own.mkdir()
    layer, folder = path, path.parent
    if _start(path).startswith(_PACKAGE):
        folder = own / "package"
        folder.mkdir()
        layer = _unpacked(path, folder)
    # USD reads more than a name into some names.
    plain = own / f"layer{_kind(layer)}"
    shutil.copyfile(layer, plain)
    glb = import_with_blender(plain, own)
    names = parse_json(read_mesh_bytes(glb.with_suffix(".json")))

    def image(name: str) -> Path:
        if name not in names:
            raise HeadError(f"a texture is put together from several images ({quoted(name)}); bake it")
        return find_below(folder, names[name], "texture")

    return read_gltf(glb, scratch, images=image)


def _unpacked(path: Path, folder: Path) -> Path:
    """The first file of a package, which is its layer; its images lie beside it."""
    files = unpack_stored(path, folder, lambda name: name.lower().endswith((*SUFFIXES[:3], *IMAGE_SUFFIXES)))
    if not files or files[0].suffix.lower() in IMAGE_SUFFIXES:
        raise HeadError("a package whose first file is no USD layer; export it again")
    return files[0]


def _kind(layer: Path) -> str:
    start = _start(layer)
    kind = next((kind for magic, kind in _LAYERS.items() if start.startswith(magic)), None)
    if kind is None:
        raise HeadError("a package whose first file is no USD layer; export it again")
    return kind


def _start(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(8)
