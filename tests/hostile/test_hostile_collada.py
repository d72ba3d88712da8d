# SPDX-License-Identifier: GPL-3.0-or-later
"""A Collada file is refused for what it names or claims, and opens nothing outside of its folder."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest
from hostile_files import JP2, png
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image

from generator.errors import HeadError
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "heads"))

from small_collada import SHOWN, TEXTURED, VERTEX, collada, geometry, write

PLAIN = collada()


def textured(image: str) -> str:
    return collada(shader=TEXTURED, image=image)


def _bomb() -> str:
    levels = [f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12)]
    document = PLAIN.replace("<COLLADA", f'<!DOCTYPE x [<!ENTITY a0 "lol">{"".join(levels)}]><COLLADA', 1)
    return document.replace("<asset>", "<asset>&a11;")


def _nested() -> str:
    """30 levels of nodes that show the next level twice: a thousand million of them."""
    level = '<node id="n{}"><instance_node url="#n{}"/><instance_node url="#n{}"/></node>'
    nodes = "".join(level.format(k, k + 1, k + 1) for k in range(30))
    last = f'<node id="n30">{SHOWN}</node>'
    return collada(
        more=f"<library_nodes>{nodes}{last}</library_nodes>", nodes='<node><instance_node url="#n0"/></node>'
    )


REFUSED = {
    "above": (textured("../private.png"), "outside of the head's folder"),
    "hidden climb": (textured("x/..%2F..%2Fprivate.png"), "outside of the head's folder"),
    "absolute": (textured("file:///etc/private.png"), "absolute path"),
    "drive": (textured("file:///C:/private.png"), "absolute path"),
    "share": (textured("\\\\server\\share\\private.png"), "absolute path"),
    "web": (textured("http://example.org/private.png"), "missing"),
    "link": (textured("linked.png"), "is a link out of"),
    "JPEG 2000": (textured("skin.jp2"), "is not an image"),
    "bomb": (textured("bomb.png"), "too many pixels"),
    "no name": (textured(""), "no file name"),
    "entities": (_bomb(), "DTD"),
    "entity of a file": (
        PLAIN.replace("<COLLADA", '<!DOCTYPE x [<!ENTITY a SYSTEM "/etc/passwd">]><COLLADA', 1),
        "DTD",
    ),
    "DTD of another file": (PLAIN.replace("<COLLADA", '<!DOCTYPE x SYSTEM "x.dtd"><COLLADA', 1), "DTD"),
    "geometry of another file": (
        collada(nodes='<node><instance_geometry url="file:///etc/a.dae#g"/></node>'),
        "lies in another file",
    ),
    "node of another file": (
        collada(nodes='<node><instance_node url="other.dae#n"/></node>'),
        "lies in another file",
    ),
    "a thousand million nodes": (_nested(), "more than 10,000 nodes"),
    "a node in itself": (
        collada(nodes='<node id="n"><instance_node url="#n"/></node>'),
        "more than 256 nodes within each other",
    ),
    "deep": (collada(nodes="<node>" * 400 + SHOWN + "</node>" * 400), "more than 256 elements"),
    "an index beyond": (
        collada(geometries=geometry(f"<triangles>{VERTEX}<p>0 1 3</p></triangles>")),
        "beyond 2",
    ),
    "a negative index": (
        collada(geometries=geometry(f"<triangles>{VERTEX}<p>0 1 -1</p></triangles>")),
        "beyond 2",
    ),
    "a polygon that says other corners": (
        collada(geometries=geometry(f"<polylist>{VERTEX}<vcount>4</vcount><p>0 1 2</p></polylist>")),
        "other corners than they say",
    ),
    "no number": (PLAIN.replace("-1 -1 0 1", "-1 -1 x 1"), "are no numbers"),
    "not finite": (PLAIN.replace("-1 -1 0 1", "-1 -1 nan 1"), "not a finite number"),
    "negative stride": (PLAIN.replace('stride="3"', 'stride="-3"'), "lies nowhere"),
    "no unit": (collada(asset='<unit meter="0"/>'), "no size"),
    "another axis": (collada(asset="<up_axis>W_UP</up_axis>"), "W_UP"),
    "cut off": (PLAIN[:900], "not a Collada file"),
    "empty": ("", "not a Collada file"),
    "another XML": ("<svg/>", "not a Collada file"),
    "no polygons": (collada(geometries=geometry("<lines/>")), "no triangles"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_collada_file_is_refused_with_its_reason(name: str, tmp_path: Path) -> None:
    document, reason = REFUSED[name]
    Image.new("RGB", (8, 8)).save(tmp_path / "private.png")
    path = write(tmp_path / "head", document)
    (path.parent / "linked.png").symlink_to(tmp_path / "private.png")
    (path.parent / "skin.jp2").write_bytes(JP2)
    (path.parent / "bomb.png").write_bytes(png(20_000, 20_000))
    with pytest.raises(HeadError) as error:
        source = find_heads(path)
        for skip in source.skipped:
            raise HeadError(f"{skip.path}: {skip.reason}")
        read_mesh(source.heads[0], tmp_path)
    assert reason in str(error.value)
    assert "\n" not in str(error.value) and "head.dae" in str(error.value)


def test_a_source_that_claims_more_than_it_holds_takes_no_room(tmp_path: Path) -> None:
    path = write(tmp_path, PLAIN.replace('count="3" stride', 'count="999999999999" stride'))
    assert len(read_mesh(find_heads(path).heads[0], tmp_path).triangles) == 1


@pytest.mark.slow
@settings(
    max_examples=int(os.environ.get("HEADTURN_FUZZ", "300")),
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
    derandomize=True,
)
@given(st.data())
def test_any_change_of_a_file_is_a_mesh_or_a_line(tmp_path: Path, data: st.DataObject) -> None:
    document = textured("skin.png")
    words = [part for part in document.replace("<", " <").replace(">", "> ").split(" ") if part]
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(words) - 1))
        kind = st.sampled_from(["", "0", "-1", "#g", "1e999", "<p>", "</p>", "nan", words[at // 2], '"'])
        words[at] = data.draw(kind)
    path = write(tmp_path, " ".join(words))
    try:
        for head in find_heads(path).heads:
            read_mesh(head, tmp_path)
    except HeadError as error:
        assert "\n" not in str(error)
