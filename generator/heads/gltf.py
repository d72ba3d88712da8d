# SPDX-License-Identifier: GPL-3.0-or-later
"""glTF 2.0 (.glb and .gltf): geometry through trimesh, materials read here.

trimesh turns a missing or broken texture into a log line and opens every image
the file names. So the JSON is read first: textures are checked and taken out,
each material is replaced by its number, and trimesh only gets geometry.
"""

from __future__ import annotations

import io
import json
import struct
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
import trimesh
from trimesh.resolvers import Resolver
from trimesh.visual import TextureVisuals

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.gltf_file import BIN, FLOAT, JSON, MAGIC, check_header, split_gltf, uri_bytes
from generator.heads.limits import (
    MAX_GEOMETRY_BYTES,
    MAX_TRIANGLES,
    MAX_VERTICES,
    check_count,
    read_mesh_bytes,
)
from generator.heads.mesh import HeadMesh, Material
from generator.heads.obj import SEE_THROUGH, SKIN
from generator.heads.paths import find_inside
from generator.heads.textures import Textures, open_image
from generator.heads.tiling import EXTEND, MIRROR, REPEAT

# Anything in the JSON may be missing or of another kind than the standard says.
# Of trimesh, too: where it has no value for a variable, that is a NameError.
_MALFORMED = (
    *(LookupError, TypeError, AttributeError, ValueError, AssertionError, RecursionError),
    *(NameError, ArithmeticError, NotImplementedError, struct.error),
)
_WRAPS = {33071: EXTEND, 33648: MIRROR, 10497: REPEAT}
WHITE = 1 - 0.5 / 255
"""Vertex colours are drawn with eight bits: from here on they are 1."""
_UNTRANSFORMED = {"offset": [0, 0], "scale": [1, 1], "rotation": 0}


class _Folder(Resolver):
    """What trimesh asks for a file by name; answers from the head's folder only."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def get(self, key: str) -> bytes:
        return read_mesh_bytes(find_inside(self.folder, unquote(key), "buffer"), MAX_GEOMETRY_BYTES)

    def keys(self) -> list[str]:
        return []

    def write(self, name: str, data: bytes) -> None:
        raise NotImplementedError("heads are only read")

    def namespaced(self, namespace: str) -> Resolver:
        raise NotImplementedError("heads have no namespaces")


@dataclass(frozen=True)
class _Source:
    """A glTF material. color: sRGB, None if not given. factor: the same, linear. mode: alphaMode.
    wraps: how the texture goes on along u and v. note: what of it is not drawn."""

    name: str
    color: tuple[float, float, float] | None = None
    factor: np.ndarray = field(default_factory=lambda: np.ones(3))
    opacity: float = 1.0
    mode: str = "OPAQUE"
    texture: Path | None = None
    wraps: tuple[str, str] = (REPEAT, REPEAT)
    note: str = ""


def read_gltf(path: Path, scratch: Path) -> HeadMesh:
    """All triangles of a glTF scene in its world frame, with their materials.

    scratch: embedded images are written there, byte for byte.

    Raises
    ------
    HeadError: the file cannot be parsed, is compressed, or a texture is
        missing, outside of the folder or not an image.
    """
    try:
        header, binary = split_gltf(path)
        check_header(header)
        textures = Textures()
        materials = _materials(header, binary, path, scratch, textures)
        return _assemble(_load_geometry(header, binary, _Folder(path.parent)), materials, textures)
    except _MALFORMED as error:
        what = f"{type(error).__name__}: {error}"
        raise HeadError(
            f"not a glTF file that can be read ({what}); export it again, uncompressed"
        ) from error


def _materials(
    header: dict[str, Any], binary: bytes, path: Path, scratch: Path, textures: Textures
) -> list[_Source]:
    """The materials of the file, then the one of primitives that name none."""
    images: dict[int | str, Path] = {}
    result = []
    for index, material in enumerate(header.get("materials", [])):
        color, reference = _base_color(material)
        factor = [float(x) for x in color or (1, 1, 1, 1)]
        texture, wraps = None, _Source.wraps
        if reference is not None:
            transform = reference.get("extensions", {}).get("KHR_texture_transform", {})
            moved = any(transform.get(key, same) != same for key, same in _UNTRANSFORMED.items())
            if moved or reference.get("texCoord", 0) != 0:
                raise HeadError("a texture uses a second or transformed set of coordinates; bake them")
            entry = header["textures"][reference["index"]]
            sampler = header["samplers"][entry["sampler"]] if "sampler" in entry else {}
            wraps = (_WRAPS[sampler.get("wrapS", 10497)], _WRAPS[sampler.get("wrapT", 10497)])
            number = entry["source"]
            image = header["images"][number]
            # Many images of a file may share their bytes.
            content: int | str = image["bufferView"] if "bufferView" in image else image["uri"]
            if content not in images:
                images[content] = _image(header, binary, number, path, scratch)
                textures.check(images[content])
            texture = images[content]
        red, green, blue = (float(x) for x in _srgb(np.array(factor[:3])))
        name = str(material.get("name", f"material{index}"))
        unseen = texture is None and "emissiveTexture" in material
        result.append(
            _Source(
                name=name,
                color=None if color is None else (red, green, blue),
                factor=np.array(factor[:3]),
                opacity=factor[3],
                mode=str(material.get("alphaMode", "OPAQUE")),
                texture=texture,
                wraps=wraps,
                note=f"the emissive texture of {quoted(name)} is not drawn" if unseen else "",
            )
        )
    return [*result, _Source("skin")]


def _base_color(material: dict[str, Any]) -> tuple[Any, Any]:
    """Factor and texture of a material, None where there is none. Where it has both kinds of colour, those of
    KHR_materials_pbrSpecularGlossiness are what the extension asks for."""
    glossy = material.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness")
    if glossy is not None:
        return glossy.get("diffuseFactor"), glossy.get("diffuseTexture")
    pbr = material.get("pbrMetallicRoughness", {})
    return pbr.get("baseColorFactor"), pbr.get("baseColorTexture")


def _image(header: dict[str, Any], binary: bytes, number: int, path: Path, scratch: Path) -> Path:
    image = header["images"][number]
    if "bufferView" in image:
        view = header["bufferViews"][image["bufferView"]]
        start = view.get("byteOffset", 0)
        uri = header["buffers"][view["buffer"]].get("uri")
        source = binary if uri is None else uri_bytes(uri, path.parent)
        data = source[start : start + view["byteLength"]]
    elif image["uri"].startswith("data:"):
        data = uri_bytes(image["uri"], path.parent)
    else:
        return find_inside(path.parent, unquote(image["uri"]), "texture")
    texture = scratch / f"{path.stem}-image{number}"
    texture.write_bytes(data)
    with open_image(texture) as opened:
        suffix = ".jpg" if opened.format in ("JPEG", "MPO") else f".{str(opened.format).lower()}"
    return texture.rename(texture.with_name(texture.name + suffix))


def _load_geometry(header: dict[str, Any], binary: bytes, folder: _Folder) -> trimesh.Scene:
    none = len(header.get("materials", []))
    dropped = {"images", "textures", "samplers", "animations", "extensions"}
    bare = {key: value for key, value in header.items() if key not in dropped}
    bare["materials"] = [{"name": str(i)} for i in range(none + 1)]
    bare["meshes"] = [
        {**mesh, "primitives": [_bare_primitive(p, none, header) for p in mesh["primitives"]]}
        for mesh in header.get("meshes", [])
    ]
    text = json.dumps(bare).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<2I", len(text), JSON) + text
    if binary:
        binary += b"\0" * (-len(binary) % 4)
        chunks += struct.pack("<2I", len(binary), BIN) + binary
    data = io.BytesIO(struct.pack("<3I", MAGIC, 2, 12 + len(chunks)) + chunks)
    scene = trimesh.load_scene(data, file_type="glb", resolver=folder, process=False)
    if not scene.graph.nodes_geometry:
        raise HeadError("the file has no meshes")
    return scene


def _bare_primitive(primitive: dict[str, Any], none: int, header: dict[str, Any]) -> dict[str, Any]:
    if "KHR_draco_mesh_compression" in primitive.get("extensions", {}):
        raise HeadError("the mesh is Draco-compressed; export it without compression")
    uv = primitive["attributes"].get("TEXCOORD_0")
    if uv is not None and header["accessors"][uv]["componentType"] != FLOAT:
        raise HeadError("the texture coordinates are stored as integers; export them as floats")
    return {**primitive, "material": primitive.get("material", none)}


def _assemble(scene: trimesh.Scene, sources: list[_Source], textures: Textures) -> HeadMesh:
    vertices, triangles, uvs, colors, index = [], [], [], [], []
    used: dict[int, int] = {}
    tinted: set[int] = set()
    problems, offset, count, colored = [], 0, 0, False
    for node in scene.graph.nodes_geometry:
        matrix, name = scene.graph[node]
        mesh = scene.geometry[name]
        if not isinstance(mesh, trimesh.Trimesh) or not isinstance(mesh.visual, TextureVisuals):
            continue  # lines and points
        number = int(mesh.visual.material.name)
        source = sources[number]
        if source.mode == "BLEND" and source.opacity < SEE_THROUGH and source.texture is None:
            problems.append(f"the see-through material {quoted(source.name)} is left out")
            continue
        faces = np.asarray(mesh.faces)
        if np.linalg.det(matrix[:3, :3]) < 0:
            faces = faces[:, ::-1]
        offset += len(mesh.vertices)
        count += len(faces)
        check_count(offset, MAX_VERTICES, "vertices")
        check_count(count, MAX_TRIANGLES, "triangles")
        if len(faces) and (faces.min() < 0 or faces.max() >= len(mesh.vertices)):
            raise HeadError(f"a face uses a vertex beyond {len(mesh.vertices) - 1}; export the mesh again")
        vertices.append(np.asarray(mesh.vertices) @ matrix[:3, :3].T + matrix[:3, 3])
        triangles.append(faces + offset - len(mesh.vertices))
        uv = mesh.visual.uv
        if uv is None and source.texture:
            raise HeadError(f"the textured material {quoted(source.name)} has no texture coordinates")
        uvs.append(np.zeros((len(faces), 3, 2), np.float32) if uv is None else np.asarray(uv)[faces])
        color = mesh.visual.vertex_attributes.get("color")
        colored |= color is not None
        if source.note:
            problems.append(source.note)
        if color is None and source.color is None and source.texture is None:
            problems.append(f"no texture or colour for {quoted(source.name)}; drawn as plain skin")
        colors.append(_vertex_colors(color, source, len(mesh.vertices)))
        if source.texture and (colors[-1] < WHITE).any():
            tinted.add(number)
        index.append(np.full(len(faces), used.setdefault(number, len(used)), dtype=np.int32))
    if not vertices:
        raise HeadError("the file has no triangles that can be seen")
    all_uv, all_index = np.concatenate(uvs).astype(np.float32), np.concatenate(index)
    materials = []
    for number, place in used.items():
        of_material = all_index == place
        material, all_uv[of_material], notes = _material(
            sources[number], number in tinted, all_uv[of_material], textures
        )
        materials.append(material)
        problems += notes
    needed = tinted or not all(m.texture for m in materials)
    return HeadMesh(
        vertices=np.concatenate(vertices),
        triangles=np.concatenate(triangles).astype(np.int32),
        uv=all_uv if any(m.texture for m in materials) else None,
        vertex_colors=np.concatenate(colors) if colored and needed else None,
        material_index=all_index,
        materials=tuple(materials),
        problems=tuple(dict.fromkeys(problems)),
    )


def _material(
    source: _Source, tinted: bool, uv: np.ndarray, textures: Textures
) -> tuple[Material, np.ndarray, list[str]]:
    """A material, the coordinates of its triangles in the image, and notes. tinted: by vertex colours."""
    material = Material(source.name, source.color or SKIN, source.texture)
    if source.texture is None:
        return material, uv, []
    red, green, blue = source.factor.tolist()
    material = replace(material, tint=(red, green, blue), vertex_tint=tinted)
    return textures.lay(material, uv, source.wraps, cut=source.mode != "OPAQUE")


def _vertex_colors(values: np.ndarray | None, source: _Source, count: int) -> np.ndarray:
    """sRGB of linear COLOR_0 times the base colour (glTF 2.0, 3.9.2); the base colour without COLOR_0.

    Of a textured material it is COLOR_0 alone, and 1 without it: the base colour is the texture's tint.
    """
    if values is None:
        plain = 1.0 if source.texture else source.color or SKIN
        return np.full((count, 3), plain, dtype=np.float32)
    color = np.asarray(values)[:, :3]
    if np.issubdtype(color.dtype, np.integer):
        color = color / np.iinfo(color.dtype).max
    return _srgb(color if source.texture else color * source.factor)


def _srgb(linear: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1 transfer of linear values, clipped to 0-1."""
    if not np.isfinite(linear).all():
        raise HeadError("a colour is not a finite number; export the mesh again")
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055).astype(np.float32)
