# SPDX-License-Identifier: GPL-3.0-or-later
"""The materials of a Collada document: colour, opacity and the images of both."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote
from xml.etree.ElementTree import Element

import numpy as np

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.collada_file import Document, numbers, text
from generator.heads.limits import MAX_MATERIALS, check_count
from generator.heads.obj import SEE_THROUGH, SKIN
from generator.heads.paths import MissingFile, find_below
from generator.heads.pieces import PieceMaterial, linear, srgb
from generator.heads.textures import Textures, combine_alpha
from generator.heads.tiling import EXTEND, MIRROR, REPEAT

_SHADERS = ("phong", "blinn", "lambert", "constant")
_WRAPS = {"MIRROR": MIRROR, "CLAMP": EXTEND, "BORDER": EXTEND, "NONE": EXTEND}
_OPAQUE, _BLEND = "OPAQUE", "BLEND"
_LINEAR = "blender"
"""How the name of the program begins that writes colours as it calculates with them, linear; others write
them as they are shown, as viewers take them."""


@dataclass(frozen=True)
class Picture:
    """An image as a material uses it. semantic: of the texture coordinates. wraps: along u and v."""

    name: str
    semantic: str
    wraps: tuple[str, str]


@dataclass(frozen=True)
class ColladaMaterial:
    """A material as it is written. color: None where it has a texture, or neither."""

    name: str
    color: tuple[float, float, float] | None = None
    texture: Picture | None = None
    opacity: float = 1.0
    opacity_map: Picture | None = None
    same_map: bool = False
    note: str = ""

    @property
    def pictures(self) -> list[Picture]:
        """What is drawn of images."""
        return [picture for picture in (self.texture, self.opacity_map) if picture]


def read_material(document: Document, material: Element) -> ColladaMaterial:
    """One element ``material``. Raises as :class:`Document` does; HeadError: an image is not in the file."""
    name = material.get("name") or material.get("id") or "material"
    effect = document.target(_needed(material.find("instance_effect")).get("url"))
    profile = _needed(effect.find("profile_COMMON"))
    shader = next(
        (found for kind in _SHADERS if (found := profile.find(f"technique/{kind}")) is not None), None
    )
    if shader is None:
        return ColladaMaterial(name)
    parameters = {entry.get("sid"): entry for entry in effect.iter("newparam")}

    def picture(entry: Element | None) -> Picture | None:
        texture = None if entry is None else entry.find("texture")
        return None if texture is None else _picture(document, parameters, texture)

    # What shines all by itself has no other colour.
    colored = shader.find("emission" if shader.tag == "constant" else "diffuse")
    transparent = shader.find("transparent")
    texture, mask = picture(colored), picture(transparent)
    opaque = "A_ONE" if transparent is None else transparent.get("opaque", "A_ONE")
    unread = mask is not None and opaque.endswith("ZERO")
    emissive = shader.find("emission/texture") is not None and texture is None
    same = mask is not None and texture is not None and mask.name == texture.name
    plain = numbers(None if colored is None else colored.find("color"))
    return ColladaMaterial(
        name=name,
        color=None if texture or len(plain) < 3 else (float(plain[0]), float(plain[1]), float(plain[2])),
        texture=texture,
        opacity=1.0 if mask else _opacity(shader, transparent, opaque),
        opacity_map=None if unread or same else mask,
        same_map=same and not unread,
        note=_note(name, unread=unread, emissive=emissive),
    )


def _note(name: str, *, unread: bool, emissive: bool) -> str:
    if unread:
        return f"the map of transparency of {quoted(name)} is not drawn"
    return f"the emissive texture of {quoted(name)} is not drawn" if emissive else ""


def _needed(element: Element | None) -> Element:
    if element is None:
        raise ValueError("a material without an effect")
    return element


def _opacity(shader: Element, transparent: Element | None, opaque: str) -> float:
    """Collada 1.4.1, chapter 7, "determining transparency"."""
    factor = shader.find("transparency/float")
    share = 1.0 if factor is None else float(text(factor))
    if transparent is None:
        return share
    color = numbers(transparent.find("color"))
    red, green, blue, alpha = color if len(color) == 4 else (1.0, 1.0, 1.0, 1.0)
    amount = float(0.212671 * red + 0.715160 * green + 0.072169 * blue if opaque.startswith("RGB") else alpha)
    return 1 - amount * share if opaque.endswith("ZERO") else amount * share


def _picture(document: Document, parameters: dict[str | None, Element], texture: Element) -> Picture:
    """From a sampler to its surface, to its image, in any of the ways that versions and programs have."""
    sid = texture.get("texture", "")
    wraps, image = (REPEAT, REPEAT), document.named(sid)
    if sid in parameters:
        sampler = parameters[sid].find("sampler2D")
        if sampler is not None:
            along_u, along_v = (_WRAPS.get(text(sampler.find(key)), REPEAT) for key in ("wrap_s", "wrap_t"))
            wraps = along_u, along_v
            instance, surface = sampler.find("instance_image"), parameters.get(text(sampler.find("source")))
            if instance is not None:
                image = document.target(instance.get("url"))
            elif surface is not None:
                image = document.named(text(surface.find("surface/init_from")))
    if image is None or image.tag != "image":
        raise HeadError(f"the texture {quoted(sid)} is not in the file; export it again")
    start = image.find("init_from")
    name = "" if start is None else text(start) or text(start.find("ref"))
    if not name:
        raise HeadError(f"the texture {quoted(sid)} has no file name; export images as files beside the mesh")
    return Picture(name, texture.get("texcoord", ""), wraps)


def find_picture(folder: Path, picture: Picture) -> Path:
    """The image file in a head's folder. Raises as :func:`generator.heads.paths.find_below` does."""
    name = _path(unquote(picture.name))
    try:
        return find_below(folder, name, "texture")
    except MissingFile:
        if (plain := _path(picture.name)) == name:
            raise
        return find_below(folder, plain, "texture")


def _path(reference: str) -> str:
    """``file:///C:/a.png`` is ``C:/a.png``, ``file:///a.png`` is ``/a.png``."""
    if not reference.lower().startswith("file:"):
        return reference
    path = reference[5:]
    path = path[2:] if path.startswith("//") else path
    return path[1:] if path[2:3] == ":" else path


class Materials:
    """The materials of a mesh in the order in which they are asked for."""

    def __init__(self, document: Document, path: Path, scratch: Path, textures: Textures) -> None:
        self._document, self._path, self._scratch, self._textures = document, path, scratch, textures
        tool = text(document.root.find("asset/contributor/authoring_tool"))
        self._linear = tool.lower().startswith(_LINEAR)
        self._numbers: dict[str, int] = {}
        self._written: list[ColladaMaterial] = []

    def number(self, identity: str) -> int:
        """Of the material with this id."""
        if identity not in self._numbers:
            self._numbers[identity] = len(self._written)
            check_count(len(self._numbers), MAX_MATERIALS, "materials")
            self._written.append(read_material(self._document, self._document.target(f"#{identity}")))
        return self._numbers[identity]

    def semantic(self, number: int | None) -> str:
        """Of the texture coordinates that a material uses."""
        pictures = [] if number is None else self._written[number].pictures
        return pictures[0].semantic if pictures else ""

    def drawn(self) -> list[PieceMaterial]:
        """All that were asked for, then the one of what has none."""
        # A head of nothing but shells has its opacity written the other way round, as of old programs.
        turned = all(m.opacity < SEE_THROUGH for m in self._written)
        return [*(self._drawn(k, m, turned) for k, m in enumerate(self._written)), PieceMaterial("skin")]

    def _drawn(self, number: int, written: ColladaMaterial, turned: bool) -> PieceMaterial:
        folder, texture = self._path.parent, None
        opacity = 1.0 if turned else written.opacity
        color, factor = self._colors(written.color)
        if written.texture:
            texture = find_picture(folder, written.texture)
            self._textures.check(texture)
        if written.opacity_map:
            combined = self._scratch / f"{self._path.stem}-cutout{number}.png"
            combine_alpha(texture or color or SKIN, find_picture(folder, written.opacity_map), combined)
            texture = combined
        holes = written.same_map or written.opacity_map is not None
        return PieceMaterial(
            name=written.name,
            color=color,
            # Of a texture the colour is in its pixels.
            factor=np.ones(3) if texture else factor,
            opacity=opacity,
            mode=_BLEND if holes or opacity < SEE_THROUGH else _OPAQUE,
            texture=texture,
            wraps=written.pictures[0].wraps if written.pictures else (REPEAT, REPEAT),
            note=written.note,
        )

    def vertex_colors(self, values: np.ndarray) -> np.ndarray:
        """Linear float32 [N, 3 or 4] of colours as they are written."""
        colors = values.astype(np.float32)
        if not self._linear:
            colors[:, :3] = linear(colors[:, :3])
        return colors

    def _colors(
        self, written: tuple[float, float, float] | None
    ) -> tuple[tuple[float, float, float] | None, np.ndarray]:
        """sRGB and linear."""
        if written is None:
            return None, np.ones(3)
        values = np.array(written)
        shown, factor = (srgb(values), values) if self._linear else (values, linear(values))
        if not np.isfinite(values).all():
            raise ValueError("a colour is not a finite number")
        red, green, blue = np.clip(shown, 0, 1).tolist()
        return (red, green, blue), factor
