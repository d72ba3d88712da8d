# SPDX-License-Identifier: GPL-3.0-or-later
"""A Collada document: its XML, without anything that could name or become more than the file holds."""

from __future__ import annotations

import io
import warnings
import xml.sax
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote
from xml.etree.ElementTree import Element, TreeBuilder
from xml.sax.handler import ContentHandler, LexicalHandler, property_lexical_handler

import numpy as np

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.limits import MAX_DEPTH, MAX_GEOMETRY_BYTES, check_count, read_mesh_bytes

MAX_ELEMENTS = 1_000_000
_UNUSED = frozenset(("extra", "library_animations", "library_animation_clips", "library_physics_models"))
"""What is not even kept: it is large, or any program's own."""


class Document:
    """The elements of a file, by names without prefix.

    Its methods raise LookupError, TypeError or ValueError for what is malformed, HeadError for what names
    another file.
    """

    def __init__(self, path: Path) -> None:
        """Raises HeadError: no XML, one with a DTD (whose entities grow without end, or are other files), or
        more than a head may have. OSError: it cannot be read."""
        builder = _Builder()
        reader = xml.sax.make_parser()
        reader.setContentHandler(builder)
        reader.setProperty(property_lexical_handler, builder)
        try:
            reader.parse(io.BytesIO(read_mesh_bytes(path, MAX_GEOMETRY_BYTES)))
            self.root = builder.tree.close()
        except xml.sax.SAXException as error:
            what = " ".join(str(error.getMessage()).split())
            raise HeadError(f"not a Collada file that can be read ({what}); export it again") from error
        if self.root.tag != "COLLADA":
            raise HeadError("not a Collada file; export it again, or as GLB")
        self._tables: dict[Element, np.ndarray] = {}
        self._by_id = {
            element.attrib["id"]: element for element in self.root.iter() if "id" in element.attrib
        }

    def target(self, reference: str | None) -> Element:
        """The element that ``#id`` names."""
        if reference is None or not reference.strip().startswith("#"):
            raise HeadError(
                f"{quoted(reference or '')} lies in another file; export all as one file, or as GLB"
            )
        return self._by_id[unquote(reference.strip()[1:])]

    def named(self, identity: str) -> Element | None:
        """The element of an id."""
        return self._by_id.get(identity)

    def table(self, source: Element) -> np.ndarray:
        """float64 [count, numbers of each] of a source."""
        if source not in self._tables:
            self._tables[source] = self._table(source)
        return self._tables[source]

    def _table(self, source: Element) -> np.ndarray:
        accessor, stored = source.find("technique_common/accessor"), source.find("float_array")
        if stored is None:
            raise ValueError("a source without numbers")
        values = numbers(stored)
        if accessor is None:
            return values[:, None]
        stride, start = int(accessor.get("stride", "1")), int(accessor.get("offset", "0"))
        count = int(accessor.get("count", "0"))
        if min(stride, start, count) < 0:
            raise ValueError("a source lies nowhere")
        return values[start : start + count * stride].reshape(-1, stride)

    def words(self, source: Element) -> list[str]:
        """The names of a source."""
        for kind in ("Name_array", "IDREF_array"):
            stored = source.find(kind)
            if stored is not None:
                return text(stored).split()
        raise ValueError("a source without names")


class _Builder(ContentHandler, LexicalHandler):
    def __init__(self) -> None:
        super().__init__()
        self.tree = TreeBuilder()
        self._depth = self._count = self._unused = 0

    def startDTD(self, name: str, public_id: str | None, system_id: str | None) -> None:
        raise HeadError("a Collada file with a DTD, which may name other files; export it again")

    def startElement(self, name: str, attrs: xml.sax.xmlreader.AttributesImpl) -> None:
        self._depth += 1
        self._count += 1
        check_count(self._depth, MAX_DEPTH, "elements within each other")
        check_count(self._count, MAX_ELEMENTS, "elements")
        local = name.rpartition(":")[2]
        if self._unused or local in _UNUSED:
            self._unused += 1
        else:
            self.tree.start(local, dict(attrs.items()))

    def characters(self, content: str) -> None:
        if not self._unused:
            self.tree.data(content)

    def endElement(self, name: str) -> None:
        self._depth -= 1
        if self._unused:
            self._unused -= 1
        else:
            self.tree.end(name.rpartition(":")[2])


def text(element: Element | None) -> str:
    """What an element holds; nothing where there is none."""
    return "" if element is None else (element.text or "").strip()


def numbers(element: Element | None, kind: type = np.float64) -> np.ndarray:
    """[N] of an element. ValueError: something in it is no number of that kind."""
    written = text(element)
    if not written:
        return np.zeros(0, kind)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            return np.fromstring(written, dtype=kind, sep=" ")
        except DeprecationWarning as error:
            raise ValueError(f"{quoted(written[:30])} are no numbers") from error


def inputs(element: Element) -> Iterator[tuple[str, int, int, str | None]]:
    """(semantic, set, offset, source) of the inputs of an element."""
    for entry in element.findall("input"):
        offset = int(entry.get("offset", "0"))
        if not 0 <= offset < 64:
            raise ValueError("an input lies nowhere")
        yield entry.get("semantic", ""), int(entry.get("set", "0")), offset, entry.get("source")
