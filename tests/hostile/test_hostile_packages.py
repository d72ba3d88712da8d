# SPDX-License-Identifier: GPL-3.0-or-later
"""A package of USD is a stranger's archive: names, sizes and kinds are checked before it is unpacked."""

from __future__ import annotations

import stat
import struct
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from generator.errors import HeadError
from generator.heads.read import read_mesh
from generator.heads.source import find_heads

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "heads"))

from small_usd import mesh, stage, usdz

LAYER = stage(mesh()).encode()


def _names(*names: str) -> Callable[[Path], None]:
    return lambda path: usdz(path, {"a.usda": LAYER, **dict.fromkeys(names, b"x")}) and None


def _link(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a.usda", LAYER)
        entry = zipfile.ZipInfo("skin.png")
        entry.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(entry, "/etc/passwd")


def _compressed(path: Path) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.usda", LAYER)


def _twice(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive, pytest.warns(UserWarning, match="Duplicate"):
        archive.writestr("a.usda", LAYER)
        archive.writestr("a.usda", LAYER)


def _edited(change: Callable[[bytearray, int], None]) -> Callable[[Path], None]:
    """change: is given the archive and where its directory begins."""

    def write(path: Path) -> None:
        usdz(path, {"a.usda": LAYER, "skin.png": b"x" * 100})
        data = bytearray(path.read_bytes())
        change(data, data.index(b"PK\1\2"))
        path.write_bytes(data)

    return write


def _encrypt(data: bytearray, at: int) -> None:
    data[at + 8] |= 1


def _grow(data: bytearray, at: int) -> None:
    """The first file claims a gigabyte, of which nothing is compressed."""
    data[at + 20 : at + 28] = struct.pack("<II", 1 << 30, 1 << 30)


def _damage(data: bytearray, at: int) -> None:
    data[200] ^= 0xFF


REFUSED: dict[str, tuple[Callable[[Path], None], str]] = {
    "above": (_names("../private.png"), "could be mistaken for a path"),
    "absolute": (_names("/private.png"), "the packed file ''"),
    "drive": (_names("C:/private.png"), "could be mistaken for a path"),
    "backslashes": (_names("..\\private.png"), "could be mistaken for a path"),
    "device": (_names("con.png"), "device in Windows"),
    "deep": (_names("a/" * 20 + "b.png"), "folders within each other"),
    "link": (_link, "is a link"),
    "compressed": (_compressed, "is compressed"),
    "twice": (_twice, "twice"),
    "encrypted": (_edited(_encrypt), "encrypted"),
    "larger than itself": (_edited(_grow), "larger than itself"),
    "damaged": (_edited(_damage), "can be read"),
    "no layer": (lambda path: usdz(path, {"skin.png": b"x", "a.usda": LAYER}) and None, "no USD layer"),
    "a layer that is none": (lambda path: usdz(path, {"a.usda": b"hello"}) and None, "no USD layer"),
    "a package in a package": (
        lambda path: usdz(path, {"a.usda": b"PK\3\4 hello"}) and None,
        "no USD layer",
    ),
    "empty": (lambda path: path.write_bytes(b"PK\3\4") and None, "can be read"),
    "no package": (lambda path: path.write_bytes(b"hello") and None, "not a USD file"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_a_package_is_refused_with_its_reason(name: str, tmp_path: Path) -> None:
    write, reason = REFUSED[name]
    folder, scratch = tmp_path / "head", tmp_path / "scratch"
    folder.mkdir()
    scratch.mkdir()
    write(folder / "head.usdz")
    with pytest.raises(HeadError) as error:
        source = find_heads(folder / "head.usdz")
        for skip in source.skipped:
            raise HeadError(skip.reason)
        read_mesh(
            source.heads[0], scratch, import_with_blender=lambda *_: pytest.fail("Blender was shown it")
        )
    assert reason in str(error.value)
    assert "\n" not in str(error.value)
    assert {path.name for path in tmp_path.iterdir()} == {"head", "scratch"}


def test_without_blender_there_is_a_way_out(tmp_path: Path) -> None:
    (tmp_path / "head.usda").write_bytes(LAYER)
    (head,) = find_heads(tmp_path).heads
    with pytest.raises(HeadError, match=r"head\.usda: USD is read by Blender.*convert it to GLB"):
        read_mesh(head, tmp_path)
