# SPDX-License-Identifier: GPL-3.0-or-later
"""Collada (.dae), read by us.

Blender's newest versions have no importer for it; that of older ones opens what a file names and believes its
indices.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from generator.errors import HeadError
from generator.heads.collada_file import Document, inputs, numbers, text
from generator.heads.collada_materials import Materials, find_picture, read_material
from generator.heads.collada_nodes import Instance, Nodes
from generator.heads.collada_skins import Shape, Shapes
from generator.heads.limits import MAX_TRIANGLES, check_count
from generator.heads.mesh import HeadMesh
from generator.heads.paths import MissingFile
from generator.heads.pieces import Piece, assemble
from generator.heads.textures import Textures
from generator.heads.triangles import of_fan, of_polygons, of_strip

_MALFORMED = (LookupError, TypeError, AttributeError, ValueError, ArithmeticError, RecursionError)
_UP = {
    "X_UP": np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]),
    "Y_UP": np.eye(3),
    "Z_UP": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
}
"""To +Y up."""

_KINDS = ("triangles", "polylist", "polygons", "tristrips", "trifans")


def read_collada(path: Path, scratch: Path) -> HeadMesh:
    """All triangles of the scene that a Collada file shows, in metres, +Y up.

    scratch: textures that are made of two images are written there.

    Raises
    ------
    HeadError: the file cannot be parsed, names parts of other files, or a texture is missing, outside of
        the folder or not an image.
    """
    try:
        document = Document(path)
        textures = Textures()
        materials = Materials(document, path, scratch, textures)
        pieces = list(_Scene(document, materials).pieces())
        return assemble(pieces, materials.drawn(), textures)
    except _MALFORMED as error:
        what = f"{type(error).__name__}: {error}"
        raise HeadError(
            f"not a Collada file that can be read ({what}); export it again, or as GLB"
        ) from error


def collada_files(path: Path) -> tuple[tuple[Path, ...], tuple[str, ...]]:
    """The images that a Collada file may be drawn with, and what is missing.

    Raises
    ------
    HeadError: no Collada, or it names a file outside of the folder.
    """
    files: dict[Path, None] = {}
    problems = []
    try:
        document = Document(path)
        for material in document.root.iterfind("library_materials/material"):
            for picture in read_material(document, material).pictures:
                try:
                    files[find_picture(path.parent, picture)] = None
                except MissingFile as error:
                    problems.append(str(error))
    except _MALFORMED as error:
        what = f"{type(error).__name__}: {error}"
        raise HeadError(
            f"not a Collada file that can be read ({what}); export it again, or as GLB"
        ) from error
    return tuple(files), tuple(dict.fromkeys(problems))


@dataclass(frozen=True)
class _Corners:
    """Triangles of one material. rows: int64 [T, 3] into table, int64 [N, inputs]."""

    symbol: str
    rows: np.ndarray
    table: np.ndarray


class _Scene:
    def __init__(self, document: Document, materials: Materials) -> None:
        self._document, self._materials = document, materials
        unit = document.root.find("asset/unit")
        meter = 1.0 if unit is None else float(unit.get("meter", "1"))
        if not 0 < meter < np.inf:
            raise ValueError("a unit of no size")
        self._to_metres = meter * _UP[text(document.root.find("asset/up_axis")) or "Y_UP"]
        self._corners = 0

    def pieces(self) -> Iterator[Piece]:
        """What the scene shows; lines are left out."""
        nodes = Nodes(self._document)
        shapes = Shapes(self._document, nodes)
        for instance in nodes.instances:
            shape = shapes.of(instance)
            if shape is not None:
                yield from self._pieces(instance, shape)

    def _pieces(self, instance: Instance, shape: Shape) -> Iterator[Piece]:
        symbols = {
            entry.get("symbol", ""): entry
            for entry in instance.element.iterfind("bind_material/technique_common/instance_material")
        }
        vertices = shape.mesh.find("vertices")
        if vertices is None:
            raise ValueError("a mesh without vertices")
        shared = [(kind, number, source) for kind, number, _, source in inputs(vertices)]
        for primitive in shape.mesh:
            if primitive.tag not in _KINDS:
                continue
            corners = _corners(primitive)
            self._corners += max(len(corners.table), 3 * len(corners.rows))
            check_count(self._corners, 3 * MAX_TRIANGLES, "corners")
            if len(corners.rows):
                entry = symbols.get(corners.symbol)
                yield self._piece(primitive, corners, shape, shared, entry)

    def _piece(
        self,
        primitive: Element,
        corners: _Corners,
        shape: Shape,
        shared: list[tuple[str, int, str | None]],
        binding: Element | None,
    ) -> Piece:
        material = self._material(corners.symbol, binding)
        index: np.ndarray | None = None
        tables: dict[tuple[str, int], tuple[str | None, np.ndarray]] = {}
        for semantic, number, offset, source in inputs(primitive):
            used = corners.table[corners.rows, offset]
            if semantic == "VERTEX":
                index = used
                tables |= {(kind, its): (uri, used) for kind, its, uri in shared}
            else:
                tables.setdefault((semantic, number), (source, used))
        if index is None:
            raise ValueError("a mesh whose corners name no vertices")
        points = _looked_up(shape.positions, index)
        if shape.mirrored.any():
            inside_out = _looked_up(shape.mirrored, index).sum(1) > 1
        else:
            inside_out = np.zeros(len(index), dtype=bool)
        uv_set = self._uv_set(material, binding, [key for key in tables if key[0] == "TEXCOORD"])
        uv = None if uv_set is None else self._values(*tables[uv_set], 2)
        color = next((self._values(*tables[key], 3) for key in tables if key[0] == "COLOR"), None)
        triangles = np.arange(index.size).reshape(-1, 3)
        return Piece(
            vertices=points.reshape(-1, 3) @ self._to_metres.T,
            triangles=np.where(inside_out[:, None], triangles[:, ::-1], triangles),
            uv=None if uv is None else uv[:, :2].astype(np.float32),
            color=None if color is None else self._materials.vertex_colors(color),
            material=material,
        )

    def _values(self, source: str | None, index: np.ndarray, least: int) -> np.ndarray:
        """float64 [corners, at least so many] of a source."""
        table = self._document.table(self._document.target(source))
        if table.shape[1] < least:
            raise ValueError("a source with too few numbers")
        return _looked_up(table, index).reshape(-1, table.shape[1])

    def _material(self, symbol: str, binding: Element | None) -> int | None:
        if binding is not None:
            target = self._document.target(binding.get("target"))
            return self._materials.number(target.attrib["id"])
        # Some programs bind nothing and write a material's id for its symbol.
        found = self._document.named(symbol)
        return self._materials.number(symbol) if found is not None and found.tag == "material" else None

    def _uv_set(
        self, material: int | None, binding: Element | None, sets: list[tuple[str, int]]
    ) -> tuple[str, int] | None:
        """The texture coordinates that the material's texture uses, else the first."""
        wanted = self._materials.semantic(material)
        for entry in [] if binding is None else binding.findall("bind_vertex_input"):
            found = (entry.get("input_semantic", ""), int(entry.get("input_set", "0")))
            if entry.get("semantic") == wanted and found in sets:
                return found
        return sets[0] if sets else None


def _looked_up(table: np.ndarray, index: np.ndarray) -> np.ndarray:
    if len(index) and (index.min() < 0 or index.max() >= len(table)):
        raise HeadError(f"a face uses an element beyond {len(table) - 1}; export the mesh again")
    return table[index]


def _corners(primitive: Element) -> _Corners:
    """The triangles of an element of :data:`_KINDS`."""
    width = 1 + max((offset for _, _, offset, _ in inputs(primitive)), default=0)
    # Of a polygon with holes, ph, the outline is drawn.
    lists = [numbers(entry, np.int64).reshape(-1, width) for entry in primitive.iter("p")]
    symbol = primitive.get("material", "")
    table = np.concatenate(lists) if lists else np.zeros((0, width), np.int64)
    if primitive.tag == "triangles":
        return _Corners(symbol, np.arange(len(table)).reshape(-1, 3), table)
    if primitive.tag in ("tristrips", "trifans"):
        cut = of_strip if primitive.tag == "tristrips" else of_fan
        starts = np.cumsum([0, *map(len, lists)])
        cuts = [
            cut(start + np.arange(len(rows)))
            for start, rows in zip(starts, lists, strict=False)
            if len(rows) > 2
        ]
        return _Corners(symbol, np.concatenate(cuts) if cuts else np.zeros((0, 3), np.int64), table)
    if primitive.tag == "polylist":
        counts = numbers(primitive.find("vcount"), np.int64)
    else:
        counts = np.array([len(rows) for rows in lists], dtype=np.int64)
    if len(counts) and (counts.min() < 0 or counts.sum() != len(table)):
        raise ValueError("polygons with other corners than they say")
    drawn = counts > 2
    if not drawn.all():
        table = table[np.repeat(drawn, counts)]
    return _Corners(symbol, of_polygons(counts[drawn])[0], table)
