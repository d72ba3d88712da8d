# SPDX-License-Identifier: GPL-3.0-or-later
"""glTF 2.0 (.glb and .gltf): its materials, and all of it as one mesh.

Not through trimesh, which turns a missing or broken texture into a log line and opens every image the
file names.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.gltf_accessors import Accessors
from generator.heads.gltf_draco import is_packed, unpack
from generator.heads.gltf_file import check_header, image_number, split_gltf, uri_bytes
from generator.heads.gltf_scene import read_pieces
from generator.heads.mesh import HeadMesh
from generator.heads.paths import find_inside
from generator.heads.pieces import PieceMaterial, assemble, srgb
from generator.heads.textures import Textures, open_image
from generator.heads.tiling import EXTEND, MIRROR, REPEAT

# Anything in the JSON may be missing or of another kind than the standard says.
_MALFORMED = (LookupError, TypeError, AttributeError, ValueError, ArithmeticError, struct.error)
_WRAPS = {33071: EXTEND, 33648: MIRROR, 10497: REPEAT}
_UNTRANSFORMED = {"offset": [0, 0], "scale": [1, 1], "rotation": 0}


def read_gltf(
    path: Path,
    scratch: Path,
    import_with_blender: Callable[[Path, Path], Path] | None = None,
    *,
    images: Callable[[str], Path] | None = None,
) -> HeadMesh:
    """All triangles of a glTF scene in its world frame, with their materials.

    scratch: embedded images are written there, byte for byte. import_with_blender: unpacks Draco.
    images: gives the file of an image by its name, instead of the glTF.

    Raises
    ------
    HeadError: the file cannot be parsed or unpacked, or a texture is
        missing, outside of the folder or not an image.
    """
    try:
        header, binary = split_gltf(path)
        check_header(header)
        textures = Textures()

        def image(number: int) -> Path:
            if images is not None:
                return images(str(header["images"][number].get("name")))
            return _image(header, binary, number, path, scratch)

        materials = _materials(header, image, textures)
        accessors = Accessors(header, binary, path.parent)
        if is_packed(header):
            header, binary = unpack(header, accessors, scratch, import_with_blender)
            accessors = Accessors(header, binary, scratch)
        return assemble(read_pieces(header, accessors), materials, textures)
    except _MALFORMED as error:
        what = f"{type(error).__name__}: {error}"
        raise HeadError(
            f"not a glTF file that can be read ({what}); export it again, uncompressed"
        ) from error


def _materials(
    header: dict[str, Any], image_file: Callable[[int], Path], textures: Textures
) -> list[PieceMaterial]:
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
            images[content] = image_file(number)
            textures.check(images[content])
        return images[content]

    result = []
    for index, material in enumerate(header.get("materials", [])):
        color, reference = _base_color(material)
        factor = [float(x) for x in color or (1, 1, 1, 1)]
        texture, wraps = texture_of(reference), _wraps(header, reference)
        clear = material.get("extensions", {}).get("KHR_materials_transmission", {})
        red, green, blue = (float(x) for x in srgb(np.array(factor[:3])))
        name = str(material.get("name", f"material{index}"))
        unseen = texture is None and "emissiveTexture" in material
        result.append(
            PieceMaterial(
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
    return [*result, PieceMaterial("skin")]


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
