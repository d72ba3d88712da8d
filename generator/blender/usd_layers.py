# SPDX-License-Identifier: GPL-3.0-or-later
"""A USD layer made plain, before Blender's importer opens whatever it names.

USD's own library, which comes with Blender's builds from 4.4 on, opens one layer without following anything
in it. What is put together from other layers or prims is refused, every asset's path is turned into that of
an image of one pixel, whose name the host knows, and the result is a file that names nothing else.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import bpy
import numpy as np

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.limits import MAX_MATERIALS, MAX_NODES, MAX_TRIANGLES, MAX_VERTICES, check_count

_COMPOSED = ("references", "payload", "inheritPaths", "specializes", "clips", "clipSets")
_TYPES = ("Material", "Shader")
_PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010806000000"
    "1f15c4890000000d49444154789c6360606060000000050001a5f645400000000049454e44ae426082"
)
"""A PNG of one transparent pixel."""


def plain_layer(source: Path, folder: Path) -> tuple[Path, dict[str, str]]:
    """A copy of a layer in folder that names only images there, and by their names what the layer says.

    Raises
    ------
    HeadError: this Blender has no USD, or the layer cannot be read, is put together from others, or holds
        more than a head may have.
    """
    sdf, utils, failed = _library()
    try:
        return _plain_layer(source, folder, sdf, utils)
    except (failed, MemoryError) as error:
        raise HeadError("not a USD layer that can be read; export it again, or as GLB") from error


def _plain_layer(source: Path, folder: Path, sdf: Any, utils: Any) -> tuple[Path, dict[str, str]]:
    layer = sdf.Layer.OpenAsAnonymous(str(source))
    _check_layer(layer, sdf)
    names: dict[str, str] = {}
    places: dict[str, str] = {}

    def pixel(asset: str) -> str:
        if asset not in places:
            check_count(len(places) + 1, MAX_MATERIALS, "names of files")
            place = folder / f"picture{len(places)}.png"
            place.write_bytes(_PIXEL)
            places[asset], names[place.stem] = str(place), asset
        return places[asset]

    utils.ModifyAssetPaths(layer, pixel)
    left: set[str] = set()

    def as_it_is(asset: str) -> str:
        left.add(asset)
        return asset

    utils.ModifyAssetPaths(layer, as_it_is)
    if not left <= set(places.values()):
        raise HeadError("its names of files cannot be made plain; export it as GLB")
    plain = folder / "plain.usdc"
    layer.Export(str(plain))
    return plain, names


def _library() -> tuple[Any, Any, type[Exception]]:
    """Sdf, UsdUtils and what they raise. The imports are no statements: few Blenders have them."""
    try:
        if "usd_import" not in dir(bpy.ops.wm):
            raise ImportError("no importer")
        bpy.utils.expose_bundled_modules()
        return import_module("pxr.Sdf"), import_module("pxr.UsdUtils"), import_module("pxr.Tf").ErrorException
    except (ImportError, AttributeError) as error:
        raise HeadError(
            f"Blender {bpy.app.version_string} cannot read USD here; open the file in the program that wrote "
            "it and export it as GLB, or build with the bpy wheel"
        ) from error


def _check_layer(layer: Any, sdf: Any) -> None:
    """Refuse what is composed or too large, and give what is animated the values it begins with."""
    paths: list[Any] = []
    layer.Traverse("/", paths.append)
    if list(layer.subLayerPaths):
        raise _composed("sublayers")
    prims = [spec for path in paths if (spec := layer.GetPrimAtPath(path))]
    check_count(len(prims), MAX_NODES, "prims")
    for spec in prims:
        for key in _COMPOSED:
            if spec.HasInfo(key):
                raise _composed(key)
        if spec.typeName == "PointInstancer":
            raise HeadError("its meshes are instances of points; export plain meshes, or as GLB")
    for path in paths:
        _still(layer, path, sdf)
    check_count(sum(spec.typeName in _TYPES for spec in prims), MAX_MATERIALS, "materials and their parts")
    skeletons = [len(_values(spec, "joints")) for spec in prims if spec.typeName == "Skeleton"]
    _check_meshes([spec for spec in prims if spec.typeName == "Mesh"], min(skeletons, default=0))


def _composed(what: str) -> HeadError:
    return HeadError(f"it is put together from parts elsewhere ({what}); flatten it, or export it as GLB")


def _still(layer: Any, path: Any, sdf: Any) -> None:
    """Of an attribute with time samples the first, where nothing is said for no time."""
    times = layer.ListTimeSamplesForPath(path) if path.IsPropertyPath() else ()
    if not times:
        return
    spec = layer.GetAttributeAtPath(path)
    first = layer.QueryTimeSample(path, times[0])
    if not spec.HasDefaultValue() and not isinstance(first, sdf.ValueBlock):
        spec.default = first
    spec.ClearInfo("timeSamples")


def _check_meshes(meshes: list[Any], joints: int) -> None:
    """Sizes, and indices that point nowhere, which importers in C++ may believe."""
    vertices = triangles = 0
    for mesh in meshes:
        points, faces = len(_values(mesh, "points")), _values(mesh, "faceVertexCounts")
        corners = _values(mesh, "faceVertexIndices")
        vertices += points
        triangles += len(corners) - 2 * len(faces)
        check_count(vertices, MAX_VERTICES, "vertices")
        check_count(max(triangles, len(corners) // 3), MAX_TRIANGLES, "triangles")
        sound = _within(corners, points) and _within(faces, len(corners) + 1) and faces.sum() == len(corners)
        for subset in mesh.nameChildren:
            sound = sound and _within(_values(subset, "indices"), len(faces))
        own = len(_values(mesh, "skel:joints")) or joints
        if not sound or not _within(_values(mesh, "primvars:skel:jointIndices"), own):
            raise HeadError(f"the mesh {quoted(mesh.name)} uses indices that point nowhere; export it again")


def _values(spec: Any, name: str) -> np.ndarray:
    """What an attribute says for no time; nothing where it is not there."""
    attribute = spec.attributes.get(name)
    return np.asarray(() if attribute is None or attribute.default is None else attribute.default)


def _within(indices: np.ndarray, count: int) -> bool:
    return not indices.size or bool(indices.min() >= 0 and indices.max() < count)
