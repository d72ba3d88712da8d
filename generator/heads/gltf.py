# SPDX-License-Identifier: GPL-3.0-or-later
"""glTF 2.0 (.glb and .gltf): its materials, and all of it as one mesh.

Not through trimesh, which turns a missing or broken texture into a log line and opens every image the
file names.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.gltf_accessors import Accessors
from generator.heads.gltf_draco import is_packed, unpack
from generator.heads.gltf_file import check_header, image_number, split_gltf, uri_bytes
from generator.heads.gltf_scene import Piece, read_pieces
from generator.heads.mesh import HeadMesh, Material
from generator.heads.obj import SEE_THROUGH, SKIN
from generator.heads.paths import find_inside
from generator.heads.textures import Textures, open_image
from generator.heads.tiling import EXTEND, MIRROR, REPEAT

# Anything in the JSON may be missing or of another kind than the standard says.
_MALFORMED = (LookupError, TypeError, AttributeError, ValueError, ArithmeticError, struct.error)
_WRAPS = {33071: EXTEND, 33648: MIRROR, 10497: REPEAT}
WHITE = 1 - 0.5 / 255
"""Vertex colours are drawn with eight bits: from here on they are 1."""
_UNTRANSFORMED = {"offset": [0, 0], "scale": [1, 1], "rotation": 0}


@dataclass(frozen=True)
class _Source:
    """A glTF material. color: sRGB, None if not given. factor: the same, linear.

    mode: alphaMode. cutoff: what MASK shows has at least this alpha. transmission: 0-1 of the light that
    passes; where, the red of transmission_map says. wraps: how the
    texture goes on along u and v. note: what of it is not drawn.
    """

    name: str
    color: tuple[float, float, float] | None = None
    factor: np.ndarray = field(default_factory=lambda: np.ones(3))
    opacity: float = 1.0
    mode: str = "OPAQUE"
    cutoff: float = 0.5
    transmission: float = 0.0
    transmission_map: Path | None = None
    texture: Path | None = None
    wraps: tuple[str, str] = (REPEAT, REPEAT)
    note: str = ""


def read_gltf(
    path: Path, scratch: Path, import_with_blender: Callable[[Path, Path], Path] | None = None
) -> HeadMesh:
    """All triangles of a glTF scene in its world frame, with their materials.

    scratch: embedded images are written there, byte for byte. import_with_blender: unpacks Draco.

    Raises
    ------
    HeadError: the file cannot be parsed or unpacked, or a texture is
        missing, outside of the folder or not an image.
    """
    try:
        header, binary = split_gltf(path)
        check_header(header)
        textures = Textures()
        materials = _materials(header, binary, path, scratch, textures)
        accessors = Accessors(header, binary, path.parent)
        if is_packed(header):
            header, binary = unpack(header, accessors, scratch, import_with_blender)
            accessors = Accessors(header, binary, scratch)
        return _assemble(read_pieces(header, accessors), materials, textures)
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

    def texture_of(reference: dict[str, Any] | None) -> Path | None:
        if reference is None:
            return None
        transform = reference.get("extensions", {}).get("KHR_texture_transform", {})
        moved = any(transform.get(key, same) != same for key, same in _UNTRANSFORMED.items())
        if moved or transform.get("texCoord", reference.get("texCoord", 0)) != 0:
            raise HeadError("a texture uses a second or transformed set of coordinates; bake them")
        number = image_number(header["textures"][reference["index"]])
        image = header["images"][number]
        # Many images of a file may share their bytes.
        content: int | str = image["bufferView"] if "bufferView" in image else image["uri"]
        if content not in images:
            images[content] = _image(header, binary, number, path, scratch)
            textures.check(images[content])
        return images[content]

    result = []
    for index, material in enumerate(header.get("materials", [])):
        color, reference = _base_color(material)
        factor = [float(x) for x in color or (1, 1, 1, 1)]
        texture, wraps = texture_of(reference), _wraps(header, reference)
        clear = material.get("extensions", {}).get("KHR_materials_transmission", {})
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
                cutoff=float(material.get("alphaCutoff", 0.5)),
                transmission=float(clear.get("transmissionFactor", 0)),
                transmission_map=texture_of(clear.get("transmissionTexture")),
                texture=texture,
                wraps=wraps,
                note=f"the emissive texture of {quoted(name)} is not drawn" if unseen else "",
            )
        )
    return [*result, _Source("skin")]


def _wraps(header: dict[str, Any], reference: dict[str, Any] | None) -> tuple[str, str]:
    """How a texture goes on along u and v."""
    texture = {} if reference is None else header["textures"][reference["index"]]
    sampler = header["samplers"][texture["sampler"]] if "sampler" in texture else {}
    return _WRAPS[sampler.get("wrapS", 10497)], _WRAPS[sampler.get("wrapT", 10497)]


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


def _assemble(pieces: Iterable[Piece], sources: list[_Source], textures: Textures) -> HeadMesh:
    vertices, triangles, uvs, colors, index = [], [], [], [], []
    used: dict[int, int] = {}
    tinted: set[int] = set()
    problems, offset, colored = [], 0, False
    for piece in pieces:
        number = len(sources) - 1 if piece.material is None else piece.material
        source, faces = sources[number], piece.triangles
        if piece.uv is None and source.texture:
            raise HeadError(f"the textured material {quoted(source.name)} has no texture coordinates")
        corner_uv = np.zeros((len(faces), 3, 2), np.float32) if piece.uv is None else piece.uv[faces]
        if _is_clear(source, corner_uv, piece.color, textures):
            problems.append(f"the see-through material {quoted(source.name)} is left out")
            continue
        vertices.append(piece.vertices)
        triangles.append(faces + offset)
        offset += len(piece.vertices)
        uvs.append(corner_uv)
        colored |= piece.color is not None
        if source.note:
            problems.append(source.note)
        if piece.color is None and source.color is None and source.texture is None:
            problems.append(f"no texture or colour for {quoted(source.name)}; drawn as plain skin")
        colors.append(_vertex_colors(piece.color, source, len(piece.vertices)))
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


def _is_clear(source: _Source, uv: np.ndarray, color: np.ndarray | None, textures: Textures) -> bool:
    """Is it a shell that a viewer looks through, such as a cornea or a film of tears?"""
    passes = source.transmission
    if passes > SEE_THROUGH and source.transmission_map:
        passes *= textures.mean_red(source.transmission_map, uv, source.wraps)
    if passes > SEE_THROUGH:
        return True
    if source.mode not in ("BLEND", "MASK"):
        return False
    opacity = source.opacity
    if source.texture:
        opacity *= textures.peak_alpha(source.texture, uv, source.wraps)
    if color is not None and color.shape[1:] == (4,) and len(color):
        opacity *= float(_fractions(color[:, 3]).max())
    return opacity < (source.cutoff if source.mode == "MASK" else SEE_THROUGH)


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
    color = _fractions(values[:, :3])
    return _srgb(color if source.texture else color * source.factor)


def _fractions(values: np.ndarray) -> np.ndarray:
    return values / np.iinfo(values.dtype).max if np.issubdtype(values.dtype, np.integer) else values


def _srgb(linear: np.ndarray) -> np.ndarray:
    """IEC 61966-2-1 transfer of linear values, clipped to 0-1."""
    if not np.isfinite(linear).all():
        raise HeadError("a colour is not a finite number; export the mesh again")
    x = np.clip(linear, 0.0, 1.0)
    return np.where(x <= 0.0031308, 12.92 * x, 1.055 * x ** (1 / 2.4) - 0.055).astype(np.float32)
