# SPDX-License-Identifier: GPL-3.0-or-later
"""From a head on disk to plain arrays."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from generator.errors import HeadError
from generator.escape import printable
from generator.heads import usd
from generator.heads.blend import read_scene
from generator.heads.collada import read_collada
from generator.heads.eyeballs import add_eyeballs
from generator.heads.fbx import check_fbx
from generator.heads.gltf import read_gltf
from generator.heads.head import SCENE, Head
from generator.heads.limits import check_mesh_file
from generator.heads.mesh import HeadMesh
from generator.heads.obj import read_obj
from generator.heads.ply import read_ply
from generator.heads.stl import read_stl
from generator.heads.surroundings import without_materials
from generator.heads.weld import weld

ImportWithBlender = Callable[..., Path]
"""(mesh file, scratch folder) -> the GLB that Blender made of it; (.blend, scratch folder, head object, shape
key) -> the package."""


def read_mesh(head: Head, scratch: Path, *, import_with_blender: ImportWithBlender | None = None) -> HeadMesh:
    """The mesh of a head in its own units and axes, one vertex per position.

    FaceScape's eye holes get eyeballs, and its mouth a dark inside. What has a material that the
    head is to be without is left out.

    Parameters
    ----------
    scratch: an existing folder of this head alone; textures that the mesh
        embeds or that are made for it are written there.
    import_with_blender: converts FBX, USD and Draco; None where no Blender can be run.

    Raises
    ------
    HeadError: the mesh or one of its textures cannot be used; the message
        names the file.
    """
    path = head.mesh_path
    try:
        if head.source == SCENE:
            return weld(read_scene(head, scratch, import_with_blender))
        check_mesh_file(path)
        if head.source == "facescape":
            mesh = add_eyeballs(weld(read_obj(path, scratch, texture=head.files[-1])), scratch)
        else:
            mesh = weld(_read(path, scratch, import_with_blender))
        return without_materials(mesh, head.without) if head.without else mesh
    except HeadError as error:
        raise HeadError(printable(f"{path}: {error}")) from error
    except OSError as error:
        raise HeadError(printable(f"{path}: cannot be read ({error.strerror})")) from error


def _read(path: Path, scratch: Path, import_with_blender: ImportWithBlender | None) -> HeadMesh:
    match path.suffix.lower():
        case ".obj":
            return read_obj(path, scratch)
        case ".ply":
            return read_ply(path, scratch)
        case ".glb" | ".gltf" | ".vrm":
            return read_gltf(path, scratch, import_with_blender)
        case ".fbx":
            if import_with_blender is None:
                raise HeadError("FBX is read by Blender, which is not available here; convert it to GLB")
            if missing := check_fbx(path):
                raise HeadError(missing[0])
            return read_gltf(import_with_blender(path, scratch), scratch)
        case ".dae":
            return read_collada(path, scratch)
        case suffix if suffix in usd.SUFFIXES:
            return usd.read_usd(path, scratch, import_with_blender)
        case ".stl":
            return read_stl(path)
    raise HeadError("not a mesh format that can be read; use OBJ, PLY, GLB, FBX, DAE or USD")
