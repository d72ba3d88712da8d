# SPDX-License-Identifier: GPL-3.0-or-later
"""Images and passes of a dataset are measured before they are decoded."""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageFile

from generator.dataset.format.part import read_part
from generator.dataset.proof.stored import decoded, read_stored
from generator.plan.settings import Dataset

PART = "data/train/part-s1-0.parquet"
ROW = {"width": 16, "height": 16}


def bomb(side: int) -> bytes:
    """A PNG that says it has side x side pixels of RGB; a kilobyte."""
    header = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(bytes(100_000))), (b"IEND", b"")]
    made = [struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in chunks]
    return b"\x89PNG\r\n\x1a\n" + b"".join(made)


@pytest.mark.parametrize(
    ("side", "says"),
    [
        (9_000, "has 9000 x 9000 pixels, its row says 16 x 16"),
        (12_000, "is larger than any image of a dataset"),  # Pillow would warn
        (20_000, "is larger than any image of a dataset"),  # Pillow would refuse
    ],
)
def test_a_large_image_is_refused_by_its_header(
    side: int, says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ImageFile.ImageFile, "load", lambda self: pytest.fail("it was decoded"))
    with pytest.raises(ValueError, match=says):
        decoded(bomb(side), ROW)


def test_pixels_of_an_image() -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (16, 16, 3), np.uint8)
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, "png")
    assert (decoded(file.getvalue(), ROW, "png") == pixels).all()
    with pytest.raises(ValueError, match="is no JPEG that can be decoded"):
        decoded(file.getvalue(), ROW, "jpg")


def drawn(size: tuple[int, int] = (16, 16), mode: str = "RGB", kind: str = "png") -> bytes:
    file = io.BytesIO()
    Image.new(mode, size).save(file, kind)
    return file.getvalue()


BAD = {
    "rubbish": (b"rubbish", "is no PNG that can be decoded"),
    "empty": (b"", "is no PNG that can be decoded"),
    "cut in its header": (drawn()[:20], "is no PNG that can be decoded"),
    "cut in its pixels": (drawn()[:50], "is no PNG that can be decoded"),
    "another format": (drawn(kind="bmp"), "is no PNG that can be decoded"),
    "JPEG": (drawn(kind="jpeg"), "is no PNG that can be decoded"),
    "another size": (drawn((16, 17)), "has 16 x 17 pixels, its row says 16 x 16"),
    "grey levels": (drawn(mode="L"), "has the channels L, expected RGB"),
    "with alpha": (drawn(mode="RGBA"), "has the channels RGBA, expected RGB"),
    "a palette": (drawn(mode="P"), "has the channels P, expected RGB"),
}


@pytest.mark.parametrize(("content", "says"), BAD.values(), ids=BAD.keys())
def test_what_is_no_image_of_its_row(content: bytes, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        decoded(content, ROW, "png")


def test_an_image_of_a_good_dataset(dataset: Path) -> None:
    row = read_part(dataset / PART).to_pylist()[0]
    stored = read_stored(dataset, row, "files", Dataset())
    assert stored.decoded and not stored.problems
    assert read_stored(dataset, row, "none", Dataset()).image is None


@pytest.mark.parametrize(
    ("path", "says"),
    [
        ("", "s1/neutral/y-30_p-20_r+0 has no passes, the configuration asks for some"),
        ("../secret.exr", "passes_path '../secret.exr' is no path inside the folder"),
        ("/etc/passwd", "passes_path '/etc/passwd' is no path inside the folder"),
        ("exr/link.exr", "passes_path 'exr/link.exr' is a link out of the folder"),
        ("exr/none.exr", "exr/none.exr: is missing"),
    ],
)
def test_passes_that_are_not_there(dataset: Path, path: str, says: str) -> None:
    pytest.importorskip("OpenEXR")
    (dataset / "exr").mkdir()
    (dataset / "exr" / "link.exr").symlink_to("/etc/passwd")
    row = {**read_part(dataset / PART).to_pylist()[0], "passes_path": path}
    stored = read_stored(dataset, row, "files", Dataset(passes=("depth",)))
    assert not stored.passes and len(stored.problems) == 1
    assert says in stored.problems[0]


@pytest.mark.parametrize(
    ("name", "size", "says"),
    [
        ("depth.Z", (64, 64), ""),
        ("depth.Z", (64, 65), "exr/a.exr has not the size of the image"),
        ("secret.Z", (64, 64), "exr/a.exr has the channels secret.Z, expected depth.Z"),
    ],
)
def test_passes_of_a_row(dataset: Path, name: str, size: tuple[int, int], says: str) -> None:
    pytest.importorskip("OpenEXR")
    from generator.dataset.format.passes import passes_sha256, write_passes

    channels = {name: np.ones(size, np.float32)}
    (dataset / "exr").mkdir()
    write_passes(channels, dataset / "exr" / "a.exr")
    row = {**read_part(dataset / PART).to_pylist()[0], "passes_path": "exr/a.exr"}
    stored = read_stored(dataset, row, "files", Dataset(passes=("depth",)))
    assert stored.problems == [says] * bool(says)
    assert stored.passes == passes_sha256(channels)
    assert "exr/a.exr, its recorded hash and the new passes" in stored.compared()
