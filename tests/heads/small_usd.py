# SPDX-License-Identifier: GPL-3.0-or-later
"""USD layers of a triangle, and packages of them."""

from __future__ import annotations

import struct
import zipfile
from pathlib import Path

HEADER = 'upAxis = "Y"\nmetersPerUnit = 1'

PLAIN = "color3f inputs:diffuseColor = (0.5, 0.1, 0)"
TEXTURED = "color3f inputs:diffuseColor.connect = </root/m/texture.outputs:rgb>"


def stage(prims: str, header: str = HEADER) -> str:
    return f'#usda 1.0\n(\ndefaultPrim = "root"\n{header}\n)\ndef Xform "root"\n{{\n{prims}\n}}\n'


def mesh(
    more: str = "",
    *,
    points: str = "point3f[] points = [(-1, -1, 0), (1, -1, 0), (1, 1, 0)]",
    faces: str = "int[] faceVertexCounts = [3]\nint[] faceVertexIndices = [0, 1, 2]",
    meta: str = 'prepend apiSchemas = ["MaterialBindingAPI"]',
) -> str:
    return f"""def Mesh "mesh" ({meta})
{{
{points}
{faces}
texCoord2f[] primvars:st = [(0, 0), (1, 0), (1, 1)] (interpolation = "vertex")
uniform token subdivisionScheme = "none"
rel material:binding = </root/m>
{more}
}}
"""


def material(surface: str = PLAIN, image: str = "skin.png", more: str = "") -> str:
    return f"""def Material "m"
{{
token outputs:surface.connect = </root/m/surface.outputs:surface>
def Shader "surface"
{{
uniform token info:id = "UsdPreviewSurface"
{surface}
token outputs:surface
}}
def Shader "texture"
{{
uniform token info:id = "UsdUVTexture"
asset inputs:file = @{image}@
float2 inputs:st.connect = </root/m/reader.outputs:result>
token inputs:wrapS = "repeat"
token inputs:wrapT = "repeat"
float outputs:a
float3 outputs:rgb
}}
def Shader "reader"
{{
uniform token info:id = "UsdPrimvarReader_float2"
string inputs:varname = "st"
float2 outputs:result
}}
{more}
}}
"""


def usdz(path: Path, files: dict[str, bytes]) -> Path:
    """A package: every file begins at a multiple of 64 bytes, and none is compressed."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        for name, data in files.items():
            entry = zipfile.ZipInfo(name)
            start = archive.start_dir + 30 + len(name.encode())
            entry.extra = struct.pack("<HH", 0x1986, -(start + 4) % 64) + bytes(-(start + 4) % 64)
            archive.writestr(entry, data)
    return path
