# SPDX-License-Identifier: GPL-3.0-or-later
"""An FBX is refused for what it names as an OBJ is, and opens nothing outside of its folder."""

from __future__ import annotations

import json
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import pytest
from hostile_files import JP2, Fbx, fbx, fbx_array, fbx_text, png
from PIL import Image

from generator.errors import HeadError
from generator.execution.lanes.renderer import Renderer
from generator.heads.fbx import check_fbx
from generator.heads.gltf_file import split_gltf
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

OUTSIDE = "outside of the head's folder"


def _array(values: bytes, claimed: int, encoding: int = 1) -> bytes:
    file = Fbx()
    file.record("Vertices", fbx_array(values, claimed, encoding))
    return file.whole()


def _deep() -> bytes:
    file = Fbx()
    nested: tuple = ("End", (), ())
    for _ in range(400):
        nested = ("Node", (), (nested,))
    file.record("Objects", children=[nested])
    return file.whole()


REFUSED = {
    "above": (fbx("../private.png"), OUTSIDE),
    "backslashes": (fbx("..\\private.png"), OUTSIDE),
    "hidden climb": (fbx("x/../../private.png"), OUTSIDE),
    "absolute": (fbx("/etc/private.png", key="FileName"), "absolute path"),
    "drive": (fbx("C:\\private.png", key="Filename"), "absolute path"),
    "share": (fbx("\\\\server\\share\\private.png", key="Filename"), "absolute path"),
    "control character": (fbx("a\0b.png"), "write a file name"),
    "link": (fbx("linked.png"), "is a link out of"),
    "absolute name of a link": (fbx("C:\\linked.png"), "is a link out of"),
    "long name": (fbx("a" * 5000), "too long"),
    "JPEG 2000": (fbx("skin.jp2"), "JPEG 2000"),
    "JPEG 2000 inside": (fbx("skin.png", content=JP2), "JPEG 2000"),
    "bomb": (fbx("bomb.png"), "too many pixels"),
    "bomb inside": (fbx("skin.png", content=png(20_000, 20_000)), "too many pixels"),
    "20,000 materials": (fbx(materials=20_000), "more than 1,000 records Material"),
    "claims gigabytes": (_array(b"", 1 << 31), "bytes of geometry"),
    "unpacks to gigabytes": (_array(zlib.compress(bytes(1 << 26)), 1), "another length"),
    "cut in an array": (_array(zlib.compress(bytes(80))[:-9], 10), "another length"),
    "no zlib": (_array(b"nonsense", 10), "cannot|can be read"),
    "deep": (_deep(), "does not lie where it should"),
    "text": (b"; FBX 7.4.0 project file", "cut off|text form"),
    "cut off": (fbx("skin.png")[:60], "cut off|does not lie"),
    "empty": (b"", "cut off"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_an_fbx_is_refused_with_its_reason(name: str, tmp_path: Path) -> None:
    data, reason = REFUSED[name]
    folder = tmp_path / "head"
    folder.mkdir()
    Image.new("RGB", (8, 8)).save(tmp_path / "private.png")
    (folder / "linked.png").symlink_to(tmp_path / "private.png")
    (folder / "skin.jp2").write_bytes(JP2)
    (folder / "bomb.png").write_bytes(png(20_000, 20_000))
    (folder / "head.fbx").write_bytes(data)
    source = find_heads(tmp_path)
    assert not source.heads
    [skip] = source.skipped
    assert any(part in skip.reason for part in reason.split("|")), skip.reason


def test_an_fbx_of_another_machine_finds_its_texture_in_the_folder(tmp_path: Path) -> None:
    """Artists' programs write the path on their own disk; Blender looks for the name beside the file."""
    for number, name in enumerate(("C:\\art\\skin.png", "..\\textures\\skin.png", "skin.png", "gone.png")):
        folder = tmp_path / f"h{number}"
        (folder / "maps").mkdir(parents=True)
        Image.new("RGB", (8, 8)).save(folder / "maps" / "skin.png")
        (folder / "head.fbx").write_bytes(fbx(name))
    heads = find_heads(tmp_path).heads
    assert [any("missing" in p for p in head.problems) for head in heads] == [False, False, False, True]


def linked_fbx(*uses: str) -> bytes:
    """A video gone.png of a texture that is used for some properties of a material."""
    video, texture, material = ((b"L" + struct.pack("<q", number)) for number in (1 << 40 | 1, 256, 3))
    name = [("RelativeFilename", (fbx_text("gone.png"),), ())]
    links = [(fbx_text("OO"), video, texture)]
    links += [(fbx_text("OP"), texture, material, fbx_text(use)) for use in uses]
    file = Fbx()
    objects = [
        ("Material", (material,), ()),
        ("Texture", (texture, fbx_text(b"skin\0\1Texture")), name),
        ("Video", (video, fbx_text(b"skin\0\1Video")), name),
    ]
    file.record("Objects", children=objects)
    file.record("Connections", children=[("C", link, ()) for link in links])
    return file.whole()


@pytest.mark.parametrize("uses", [["DiffuseColor"], ["NormalMap", "TransparencyFactor"], []])
def test_a_missing_texture_refuses(uses: list[str], tmp_path: Path) -> None:
    """Blender would draw that head as plain skin."""
    (tmp_path / "head.fbx").write_bytes(linked_fbx(*uses))
    [head] = find_heads(tmp_path / "head.fbx").heads
    assert "'gone.png' is missing" in head.problems[0]
    with pytest.raises(HeadError, match=r"the texture 'gone\.png' is missing; put it into"):
        read_mesh(head, tmp_path, import_with_blender=lambda *_: pytest.fail("it was imported"))


def test_a_missing_texture_that_is_not_drawn_does_not(tmp_path: Path) -> None:
    (tmp_path / "head.fbx").write_bytes(linked_fbx("NormalMap", "SpecularFactor"))
    assert check_fbx(tmp_path / "head.fbx") == ()


def test_an_embedded_texture_may_have_any_name(tmp_path: Path) -> None:
    skin = tmp_path / "skin.png"
    Image.new("RGB", (8, 8)).save(skin)
    (tmp_path / "head.fbx").write_bytes(fbx("..\\..\\skin.png", content=skin.read_bytes()))
    assert len(find_heads(tmp_path / "head.fbx").heads) == 1
    assert fbx_text("a") == b"S\1\0\0\0a"


EXPORT = """
import bpy, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.obj_import(filepath=sys.argv[1])
if sys.argv[3] == "inside":
    bpy.ops.export_scene.fbx(filepath=sys.argv[2], path_mode="COPY", embed_textures=True)
else:
    bpy.ops.export_scene.fbx(filepath=sys.argv[2], path_mode="RELATIVE")
"""


@pytest.mark.parametrize("where", ["outside", "inside"])
def test_blender_opens_no_image_outside_of_the_folder(where: str, renderer: Renderer, tmp_path: Path) -> None:
    """Also without the check before: the worker loads images from the head's folder alone."""
    folder = tmp_path / "head"
    folder.mkdir()
    Image.new("RGB", (8, 8), (200, 10, 30)).save(tmp_path / "private.png")
    (tmp_path / "h.mtl").write_text("newmtl skin\nmap_Kd private.png\n")
    (tmp_path / "h.obj").write_text(
        "mtllib h.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nusemtl skin\nf 1/1 2/2 3/3\n"
    )
    command = [sys.executable, "-c", EXPORT, str(tmp_path / "h.obj"), str(folder / "head.fbx"), where]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    source = find_heads(folder)
    for copy in folder.rglob("*.png"):
        copy.unlink()  # of the export: only what the FBX itself holds is left
    header, _ = split_gltf(renderer.import_mesh(folder / "head.fbx", tmp_path))
    if where == "outside":
        assert OUTSIDE in source.skipped[0].reason
        assert "images" not in header, json.dumps(header)
    else:
        assert len(source.heads) == 1
        assert len(header["images"]) == 1
