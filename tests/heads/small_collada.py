# SPDX-License-Identifier: GPL-3.0-or-later
"""Collada files of a few triangles."""

from __future__ import annotations

from pathlib import Path

from PIL import Image

CORNERS = "-1 -1 0 1 -1 0 1 1 0"
TRIANGLE = '<triangles material="m" count="1">{inputs}<p>0 0 1 1 2 2</p></triangles>'
VERTEX = '<input semantic="VERTEX" source="#v" offset="0"/>'
TEXCOORD = '<input semantic="TEXCOORD" source="#uv" offset="1" set="0"/>'


def source(name: str, values: str, width: int) -> str:
    count = len(values.split())
    return (
        f'<source id="{name}"><float_array id="{name}-a" count="{count}">{values}</float_array>'
        f'<technique_common><accessor source="#{name}-a" count="{count // width}" stride="{width}"/>'
        "</technique_common></source>"
    )


def geometry(primitives: str | None = None, more: str = "", corners: str = CORNERS) -> str:
    if primitives is None:
        primitives = TRIANGLE.format(inputs=VERTEX + TEXCOORD)
    return (
        f'<geometry id="g"><mesh>{source("p", corners, 3)}{source("uv", "0 0 1 0 1 1", 2)}{more}'
        f'<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>{primitives}</mesh></geometry>'
    )


PLAIN = "<phong><diffuse><color>0.2 0.4 0.6 1</color></diffuse></phong>"
TEXTURED = '<lambert><diffuse><texture texture="s" texcoord="UV"/></diffuse></lambert>'


def bound(symbol: str = "m", target: str = "#m", more: str = "") -> str:
    """What binds a material to the triangles."""
    return (
        f'<bind_material><technique_common><instance_material symbol="{symbol}" target="{target}">{more}'
        "</instance_material></technique_common></bind_material>"
    )


SHOWN = f'<instance_geometry url="#g">{bound()}</instance_geometry>'


def collada(
    *,
    shader: str = PLAIN,
    image: str = "skin.png",
    sampler: str = "",
    asset: str = "",
    geometries: str | None = None,
    nodes: str = f"<node>{SHOWN}</node>",
    more: str = "",
) -> str:
    """A document of one material "m", whose sampler "s" is of an image."""
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>{asset}</asset>
<library_images><image id="i"><init_from>{image}</init_from></image></library_images>
<library_effects><effect id="e"><profile_COMMON>
<newparam sid="f"><surface type="2D"><init_from>i</init_from></surface></newparam>
<newparam sid="s"><sampler2D><source>f</source>{sampler}</sampler2D></newparam>
<technique sid="common">{shader}</technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m" name="skin"><instance_effect url="#e"/></material></library_materials>
<library_geometries>{geometry() if geometries is None else geometries}</library_geometries>{more}
<library_visual_scenes><visual_scene id="w">{nodes}</visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#w"/></scene></COLLADA>"""


def write(folder: Path, document: str, *, image: bool = True) -> Path:
    folder.mkdir(exist_ok=True)
    (folder / "head.dae").write_text(document, encoding="utf-8")
    if image:
        Image.new("RGB", (8, 8), (200, 150, 130)).save(folder / "skin.png")
    return folder / "head.dae"
