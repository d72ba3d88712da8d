# SPDX-License-Identifier: GPL-3.0-or-later
"""Head files come from strangers: each of these is refused with its reason, the others are read."""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from small_meshes import FACES, TETRAHEDRON, plain_obj, textured_obj

from generator.heads.describe import describe_source
from generator.heads.source import find_heads


def _bomb(path: Path) -> None:
    """A valid PNG header that claims 60000 x 60000 pixels."""
    chunks = [
        (b"IHDR", struct.pack(">IIBBBBB", 60000, 60000, 8, 0, 0, 0, 0)),
        (b"IDAT", zlib.compress(b"\0")),
        (b"IEND", b""),
    ]
    data = b"\x89PNG\r\n\x1a\n"
    for kind, body in chunks:
        data += struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
    path.write_bytes(data)


def _obj(text: str) -> Callable[[Path], None]:
    return lambda folder: folder.joinpath("head.obj").write_text(text)  # type: ignore[arg-type, return-value]


def _mtl(map_kd: str) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        Image.new("RGB", (8, 8)).save(folder.parent / "outside.png")
        textured_obj(folder, map_kd)

    return write


def _absolute(folder: Path) -> None:
    Image.new("RGB", (8, 8)).save(folder.parent / "outside.png")
    textured_obj(folder, str(folder.parent / "outside.png"))


def _link(folder: Path) -> None:
    Image.new("RGB", (8, 8)).save(folder.parent / "outside.png")
    textured_obj(folder, image=False)
    (folder / "skin.png").symlink_to(folder.parent / "outside.png")


def _image(data: bytes) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        textured_obj(folder)
        (folder / "skin.png").write_bytes(data)

    return write


def _image_bomb(folder: Path) -> None:
    textured_obj(folder)
    _bomb(folder / "skin.png")


def _float_tiff(samples: int) -> bytes:
    """A TIFF of 2 x 2 pixels of 32-bit floating-point numbers."""
    short, long = 3, 4
    entries = [(256, long, 2), (257, long, 2), (258, short, 32), (259, short, 1)]
    entries += [(262, short, 2 if samples == 3 else 1), (273, long, 200), (277, short, samples)]
    entries += [(278, long, 2), (279, long, 16 * samples), (339, short, 3)]
    body = b"".join(struct.pack("<HHII", tag, kind, 1, value) for tag, kind, value in entries)
    head = b"II*\0" + struct.pack("<IH", 8, len(entries)) + body + bytes(4)
    return head.ljust(200, b"\0") + bytes(16 * samples)


def _truncated(folder: Path) -> None:
    textured_obj(folder, "skin.jpg")
    Image.effect_noise((256, 256), 50).save(folder / "skin.jpg")
    (folder / "skin.jpg").write_bytes((folder / "skin.jpg").read_bytes()[:4000])


def _gltf(change: Callable[[dict], None]) -> Callable[[Path], None]:
    def write(folder: Path) -> None:
        Image.new("RGB", (8, 8)).save(folder.parent / "outside.png")
        material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.new("RGB", (8, 8)))
        ball = trimesh.creation.icosphere(subdivisions=1)
        ball.visual = trimesh.visual.TextureVisuals(uv=np.zeros((42, 2)), material=material)
        for name, data in trimesh.Scene(ball).export(file_type="gltf").items():
            (folder / name.replace("model.gltf", "head.gltf")).write_bytes(data)
        header = json.loads((folder / "head.gltf").read_text())
        change(header)
        (folder / "head.gltf").write_text(json.dumps(header))

    return write


def _nan_uv(folder: Path) -> None:
    material = trimesh.visual.material.PBRMaterial(
        alphaMode="MASK", baseColorTexture=Image.new("RGBA", (8, 8))
    )
    ball = trimesh.creation.icosphere(subdivisions=1)
    ball.visual = trimesh.visual.TextureVisuals(uv=np.full((42, 2), np.nan), material=material)
    (folder / "head.glb").write_bytes(trimesh.Scene(ball).export(file_type="glb"))


def _set(*path: object) -> Callable[[dict], None]:
    def change(header: dict) -> None:
        *keys, last, value = path
        for key in keys:
            header = header[key]  # type: ignore[index]
        header[last] = value

    return change


def _ply(body: bytes) -> Callable[[Path], None]:
    return lambda folder: folder.joinpath("head.ply").write_bytes(body)  # type: ignore[arg-type, return-value]


PLY = b"ply\nformat ascii 1.0\nelement vertex %d\nproperty float x\nproperty float y\nproperty float z\n"
PLY_FACE = b"element face 1\nproperty list uchar int vertex_indices\nend_header\n"

OUTSIDE = "outside of the head's folder"

HOSTILE: dict[str, tuple[Callable[[Path], None], str]] = {
    "texture above the folder": (_mtl("../outside.png"), OUTSIDE),
    "backslashes above the folder": (_mtl("..\\outside.png"), OUTSIDE),
    "hidden climb": (_mtl("x/../../outside.png"), OUTSIDE),
    "absolute texture": (_absolute, "absolute path"),
    "drive letter": (_mtl("C:\\gone.png"), "absolute path"),
    "drive and a climb": (_mtl("C:\\maps\\..\\..\\outside.png"), OUTSIDE),
    "drive in a drive": (_mtl("C:\\D:\\gone.png"), "absolute path"),
    "linked texture": (_link, "link out of"),
    "folder as texture": (_mtl("."), "not a file"),
    "texture is text": (_image(b"<html>"), "not an image"),
    "texture of floats": (_image(_float_tiff(1)), "floating-point"),
    "texture of three floats": (_image(_float_tiff(3)), "floating-point"),
    "texture is empty": (_image(b""), "not an image"),
    "texture is cut off": (_truncated, "broken"),
    "decompression bomb": (_image_bomb, "too many pixels"),
    "material outside": (_obj(f"mtllib ../../x.mtl\n{TETRAHEDRON}{FACES}"), OUTSIDE),
    "huge index": (_obj(f"{TETRAHEDRON}f 1 2 1000000000\n"), "outside of 1 to 4"),
    "absurd index": (_obj(f"{TETRAHEDRON}f 1 2 {10**30}\n"), "line 5"),
    "index zero": (_obj(f"{TETRAHEDRON}f 0 1 2\n"), "line 5"),
    "before the start": (_obj(f"{TETRAHEDRON}f -9 1 2\n"), "line 5"),
    "texture index": (_obj(f"{TETRAHEDRON}f 1/7 2/7 3/7\n"), "texture coordinate"),
    "not a number": (_obj(TETRAHEDRON.replace("10", "nan", 1) + FACES), "not a finite number"),
    "infinite": (_obj(TETRAHEDRON.replace("10", "inf", 1) + FACES), "not a finite number"),
    "far away": (_obj(TETRAHEDRON.replace("10", "1e30", 1) + FACES), "coordinate"),
    "no area": (_obj("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n"), "no triangle has an area"),
    "one point": (_obj("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n"), "no triangle has an area"),
    "no faces": (_obj(TETRAHEDRON), "no faces"),
    "empty": (_obj(""), "no"),
    "noise": (_obj("\x00\x01f\x02 v v v"), "no"),
    "short vertex": (_obj("v 1 2\nf 1 1 1\n"), "three numbers"),
    "texture coordinate of words": (_obj(f"{TETRAHEDRON}vt a b\nf 1/1 2/1 3/1\n"), "not a number"),
    "words": (_obj("v a b c\nf 1 1 1\n"), "three numbers"),
    "edge as face": (_obj(f"{TETRAHEDRON}f 1 2\n"), "line 5"),
    "glTF texture outside": (_gltf(_set("images", 0, "uri", "../outside.png")), OUTSIDE),
    "glTF quoted climb": (_gltf(_set("images", 0, {"uri": "%2e%2e/outside.png"})), OUTSIDE),
    "glTF buffer outside": (_gltf(_set("buffers", 0, "uri", "/etc/hostname")), "absolute path"),
    "glTF text as image": (_gltf(_set("images", 0, {"uri": "data:image/png;base64,AAAA"})), "not an image"),
    "glTF huge accessor": (_gltf(_set("accessors", 0, "count", 10**12)), "claims"),
    "glTF node loop": (_gltf(_set("nodes", 0, "children", [0])), "not a tree"),
    "glTF compressed": (_gltf(_set("extensionsRequired", ["EXT_meshopt_compression"])), "EXT_meshopt"),
    "glTF texture coordinates": (_nan_uv, "not a finite number"),
    "glTF nonsense": (_gltf(_set("materials", 0, 5)), "not a glTF file"),
    "glTF version 1": (_gltf(_set("asset", "version", "1.0")), "not a glTF 2.0 file"),
    "PLY without header": (_ply(b"hello"), "no PLY header"),
    "PLY count": (_ply(PLY % 10**12 + PLY_FACE + b"0 0 0\n3 0 0 0\n"), "no faces"),
    "PLY words": (_ply(PLY % 3 + PLY_FACE + b"0 0 0\n1 0 x\n0 1 0\n3 0 1 2\n"), "not a PLY file"),
    "PLY index": (_ply(PLY % 3 + PLY_FACE + b"0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"), "outside of 0 to 2"),
    "PLY texture outside": (
        _ply(PLY.replace(b"element", b"comment TextureFile ../outside.png\nelement") % 3 + PLY_FACE),
        OUTSIDE,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_head_is_refused_and_its_neighbour_read(tmp_path: Path, name: str) -> None:
    write, reason = HOSTILE[name]
    plain_obj(tmp_path / "good" / "head.obj")
    folder = tmp_path / "bad"
    folder.mkdir()
    write(folder)
    rows = {row["subject"]: row for row in describe_source(find_heads(tmp_path), deep=True)}
    assert rows["good"]["vertices"] == 4
    assert rows["bad"]["vertices"] is None
    problem = rows["bad"]["problems"][-1]
    assert reason in problem
    assert "\n" not in problem


@pytest.mark.parametrize(
    "name", ["a\nb", "a..b", "a.. ", "tab\there", "x" * 101, "bell\x07", "bad\udcff", "a:b", "\u202eevil"]
)
def test_names_that_could_be_something_else_are_refused(tmp_path: Path, name: str) -> None:
    plain_obj(tmp_path / "good" / "head.obj")
    plain_obj(tmp_path / name / "head.obj")
    plain_obj(tmp_path / "card" / "head.obj")
    try:
        card = json.dumps(
            {"subject": name, "expressions": {"neutral": "head.obj"}}, ensure_ascii=False
        ).encode()
    except UnicodeEncodeError:
        card = b'{"subject": "\xff", "expressions": {}}'
    (tmp_path / "card" / "head.json").write_bytes(card)
    source = find_heads(tmp_path)
    assert [head.subject for head in source.heads] == ["good"]
    assert len(source.skipped) == 2
    for skip in source.skipped:
        assert (skip.subject + skip.reason).isprintable()


def test_names_of_people_are_fine(tmp_path: Path) -> None:
    for name in ("Zoë", "王芳", "O'Neill, Jr", "subject_01-a"):
        plain_obj(tmp_path / name / "head.obj")
    assert len(find_heads(tmp_path).heads) == 4


@pytest.mark.parametrize("mesh", ["../good/head.obj", "/etc/hostname", "head.txt", ""])
def test_a_card_cannot_point_elsewhere(tmp_path: Path, mesh: str) -> None:
    plain_obj(tmp_path / "good" / "head.obj")
    (tmp_path / "bad").mkdir()
    (tmp_path / "bad" / "head.txt").touch()
    (tmp_path / "bad" / "head.json").write_text(json.dumps({"expressions": {"neutral": mesh}}))
    source = find_heads(tmp_path)
    assert [head.subject for head in source.heads] == ["good"]
    assert [skip.subject for skip in source.skipped] == ["bad"]


def test_a_mesh_that_is_no_file_and_a_circle_of_links(tmp_path: Path) -> None:
    plain_obj(tmp_path / "good" / "head.obj")
    (tmp_path / "good" / "again").symlink_to(tmp_path)
    (tmp_path / "dangling").mkdir()
    (tmp_path / "dangling" / "head.obj").symlink_to(tmp_path / "nowhere")
    source = find_heads(tmp_path)
    assert any(head.mesh_path == tmp_path / "good" / "head.obj" for head in source.heads)
    assert any("not a file" in skip.reason for skip in source.skipped)
