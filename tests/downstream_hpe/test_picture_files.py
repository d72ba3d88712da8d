# SPDX-License-Identifier: MIT
"""Pictures of every kind: deep, of floats, turned, huge, of formats that need a package; and what is none."""

from __future__ import annotations

import builtins
import contextlib
import io
import os
import struct
import subprocess
import sys
import zlib
from pathlib import Path

import numpy as np
import pytest
from clips import bars, corners, quarters, rows_of
from PIL import Image

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.prediction import modes, pictures
from downstream_hpe.prediction.animation import Animation
from downstream_hpe.prediction.depth import from_floats, from_whole
from downstream_hpe.prediction.inputs import find_sources
from downstream_hpe.prediction.kinds import DRAWN_PICTURES, MEDIA
from downstream_hpe.prediction.pictures import read_bgr, read_picture

ROOT = Path(__file__).resolve().parents[2]
RAMP = np.add.outer(np.arange(48), np.arange(64)).astype(np.uint8) * 2
"""uint8 [48, 64]."""
COLOUR = np.dstack([RAMP, RAMP[::-1], 255 - RAMP])


def png16(path: Path, values: np.ndarray) -> None:
    """uint16 [H, W], [H, W, 3] or [H, W, 4] as PNG."""
    height, width = values.shape[:2]
    kind = {2: 0, 3: {3: 2, 4: 6}.get(values.shape[-1], 0)}[values.ndim]
    rows = values.astype(">u2").reshape(height, -1).tobytes()
    stride = len(rows) // height
    raw = b"".join(b"\0" + rows[n : n + stride] for n in range(0, len(rows), stride))
    parts = [(b"IHDR", struct.pack(">IIBBBBB", width, height, 16, kind, 0, 0, 0))]
    parts += [(b"IDAT", zlib.compress(raw)), (b"IEND", b"")]
    chunks = (struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in parts)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))


def alike(path: Path, expected: np.ndarray, by: float = 1.0) -> None:
    """Whether a file is read as uint8 [H, W] or, RGB, [H, W, 3]."""
    rgb = read_bgr(path)[..., ::-1].astype(float)
    expected = expected if expected.ndim == 3 else np.dstack([expected] * 3)
    assert rgb.shape == expected.shape and np.abs(rgb - expected).max() <= by, path


def test_sixteen_bits_are_read_as_eight_are(tmp_path):
    for name, values in (("grey", RAMP), ("rgb", COLOUR), ("rgba", np.dstack([COLOUR, RAMP]))):
        png16(tmp_path / f"{name}.png", values.astype(np.uint16) * 257)
        alike(tmp_path / f"{name}.png", values[..., :3] if values.ndim == 3 else values)
    Image.fromarray(RAMP.astype(np.uint16) * 257).save(tmp_path / "grey.tif")
    alike(tmp_path / "grey.tif", RAMP)
    Image.fromarray(RAMP.astype(np.int32) * 257).save(tmp_path / "i.tif")
    alike(tmp_path / "i.tif", RAMP)
    # Two that Pillow takes for others: a plane a colour, and white that is zero.
    tifffile = pytest.importorskip("tifffile")
    deep, apart = COLOUR.astype(np.uint16) * 257, {"planarconfig": "separate"}
    tifffile.imwrite(tmp_path / "apart.tif", np.moveaxis(deep, -1, 0), photometric="rgb", **apart)
    alike(tmp_path / "apart.tif", COLOUR)
    tifffile.imwrite(tmp_path / "negative.tif", 65535 - deep[..., 0], photometric="miniswhite")
    alike(tmp_path / "negative.tif", RAMP, by=2)
    # Of 10 and 12 bits, in files that say 16.
    for white in (1023, 4095):
        png16(tmp_path / "camera.png", np.round(RAMP * (white / 255)))
        alike(tmp_path / "camera.png", RAMP * (255 * white / 255 // 1 / white), by=3)


def test_floats_are_read(tmp_path):
    tifffile = pytest.importorskip("tifffile")
    for white in (1.0, 255.0, 65535.0):
        Image.fromarray((RAMP / np.float32(255) * np.float32(white)).astype(np.float32)).save(
            tmp_path / "f.tif"
        )
        alike(tmp_path / "f.tif", RAMP)
    for name, values in (("rgb", COLOUR), ("rgba", np.dstack([COLOUR, RAMP])), ("f64", RAMP)):
        kind = np.float64 if name == "f64" else np.float32
        extra = {"photometric": "rgb"} if values.ndim == 3 else {}
        tifffile.imwrite(tmp_path / "t.tif", (values / 255).astype(kind), **extra)
        alike(tmp_path / "t.tif", values[..., :3] if values.ndim == 3 else values)
    planes = np.moveaxis(COLOUR, -1, 0) / np.float32(255)
    tifffile.imwrite(
        tmp_path / "p.tif", planes.astype(np.float32), photometric="rgb", planarconfig="separate"
    )
    alike(tmp_path / "p.tif", COLOUR)


def test_light_is_read(tmp_path):
    av = pytest.importorskip("av")
    planes = np.ascontiguousarray((COLOUR / np.float32(255)) ** np.float32(2.2), dtype=np.float32)
    for ending, codec, form in (("exr", "exr", "gbrpf32le"), ("hdr", "hdr", "gbrpf32le")):
        context = av.CodecContext.create(codec, "w")
        context.width, context.height, context.pix_fmt = 64, 48, form
        context.time_base = 1
        frame = av.VideoFrame.from_ndarray(planes, format=form)
        content = b"".join(bytes(packet) for packet in (*context.encode(frame), *context.encode(None)))
        (tmp_path / f"a.{ending}").write_bytes(content)
        found = read_bgr(tmp_path / f"a.{ending}")[..., ::-1]
        assert found.shape == (48, 64, 3)
        # Brighter where it was, whatever the exposure.
        assert np.corrcoef(found[..., 0].ravel(), COLOUR[..., 0].ravel())[0, 1] > 0.98
        assert 60 < np.median(found) < 190


@pytest.mark.parametrize("kind", [np.float16, np.float32])
@pytest.mark.parametrize("channels", ["Y", "RGB", "RGBA"])
def test_light_of_halves_is_read(channels, kind, tmp_path):
    """Most OpenEXR files hold 16 bits a number."""
    OpenEXR = pytest.importorskip("OpenEXR")
    light = 40 * (np.dstack([COLOUR, np.full_like(RAMP, 255)]) / np.float32(255)) ** np.float32(2.2)
    values = light[..., 0] if channels == "Y" else light[..., : len(channels)]
    part = {channels: OpenEXR.Channel(np.ascontiguousarray(values, dtype=kind))}
    OpenEXR.File({}, part).write(str(tmp_path / "a.exr"))
    found = read_bgr(tmp_path / "a.exr")[..., ::-1]
    assert found.shape == (48, 64, 3) and 60 < np.median(found) < 190
    for n in range(3):
        expected = COLOUR[..., 0 if channels == "Y" else n]
        assert np.corrcoef(found[..., n].ravel(), expected.ravel())[0, 1] > 0.95


def test_numbers_that_are_no_brightness():
    assert from_floats(np.array([np.nan, np.inf, -np.inf, 0.5])).tolist() == [0, 128, 0, 128]
    with pytest.raises(DataError, match="no finite value"):
        from_floats(np.array([np.nan]))
    assert from_floats(np.array([0.5, 3.0])).tolist() == [128, 255]  # a highlight
    assert from_whole(np.array([-5, 0, 70_000])).tolist() == [0, 0, 255]


@pytest.mark.parametrize("mode", ["1", "L", "LA", "P", "PA", "RGBA", "CMYK", "YCbCr", "I;16", "F", "LAB"])
def test_modes_of_pillow(mode, tmp_path):
    image = Image.fromarray(quarters())
    if mode == "LAB":
        from PIL import ImageCms

        profiles = ImageCms.createProfile("sRGB"), ImageCms.createProfile("LAB")
        image = ImageCms.profileToProfile(image, *profiles, outputMode="LAB")
    elif mode == "P":
        image = image.quantize(8)
    else:
        image = image.convert("L").convert(mode) if mode in ("PA", "I;16") else image.convert(mode)
    if mode in ("PA",):
        found = np.asarray(pictures.rgb_of_mode(image))
    else:
        ending = {"LA": "png", "P": "png", "RGBA": "png", "1": "png"}.get(mode, "tif")
        image.save(tmp_path / f"a.{ending}")
        found = read_bgr(tmp_path / f"a.{ending}")
    assert found.shape == (64, 96, 3)
    if mode == "1":
        assert found.max() == 255 and found.min() == 0
    elif mode == "I;16":
        assert np.ptp(found) > 0
    else:
        assert corners(found) == [40, 100, 160, 220]


@pytest.mark.parametrize("ending", ["jpg", "tif", "png"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_exif_says_which_way_up(orientation, ending, tmp_path):
    exif = Image.Exif()
    exif[0x0112] = orientation
    upright = quarters()
    # How it lies in the file, by the tag's definition.
    stored = upright if orientation < 5 else np.swapaxes(upright, 0, 1)
    rows, columns = {
        1: (1, 1),
        2: (1, -1),
        3: (-1, -1),
        4: (-1, 1),
        5: (1, 1),
        6: (-1, 1),
        7: (-1, -1),
        8: (1, -1),
    }[orientation]
    image = Image.fromarray(np.ascontiguousarray(stored[::rows, ::columns]))
    image.save(tmp_path / f"a.{ending}", exif=exif)
    found = read_bgr(tmp_path / f"a.{ending}")
    assert found.shape == (64, 96, 3) and corners(found) == [40, 100, 160, 220]
    image.convert("L").save(tmp_path / f"grey.{ending}", exif=exif)
    assert corners(read_bgr(tmp_path / f"grey.{ending}")) == [40, 100, 160, 220]
    if ending == "png":  # also of several frames, and of floats
        image.save(tmp_path / "b.png", exif=exif, save_all=True, append_images=[image.point(lambda v: v + 9)])
        with contextlib.closing(Animation(tmp_path / "b.png", "b.png")) as moving:
            frames = list(moving)
        assert moving.size == (96, 64) and len(frames) == 2
        assert corners(frames[1][0]) == [40, 100, 160, 220]
        tifffile = pytest.importorskip("tifffile")
        turned = [(274, "H", 1, orientation, False)]
        floats = np.asarray(image) / np.float32(255)
        tifffile.imwrite(tmp_path / "c.tif", floats, photometric="rgb", extratags=turned)
        assert corners(read_bgr(tmp_path / "c.tif")) == [40, 100, 160, 220]


def test_heic_is_read_or_says_what_to_install(tmp_path, monkeypatch):
    heif = pytest.importorskip("pillow_heif")
    heif.register_heif_opener()
    Image.fromarray(quarters()).save(tmp_path / "a.heic", quality=95)
    assert corners(read_bgr(tmp_path / "a.heic")) == [40, 100, 160, 220]
    assert len(find_sources([str(tmp_path)])) == 1
    real = builtins.__import__

    def without(name, *arguments, **options):
        if name == "pillow_heif":
            raise ImportError(name)
        return real(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", without)
    monkeypatch.delitem(Image.OPEN, "HEIF")
    pictures.has_heif.cache_clear()
    with pytest.raises(
        DataError, match=r"a\.heic: .*HEIC is read where pillow-heif is: pip install pillow-heif$"
    ):
        read_bgr(tmp_path / "a.heic")
    monkeypatch.undo()
    pictures.has_heif.cache_clear()


@pytest.mark.parametrize("ending", ["gif", "ppm", "avif", "webp", "bmp"])
def test_other_formats(ending, tmp_path):
    if ending == "avif" and "AVIF" not in pictures.formats():
        pytest.skip("this Pillow reads no AVIF")
    Image.fromarray(quarters()).save(tmp_path / f"a.{ending}")
    assert corners(read_bgr(tmp_path / f"a.{ending}")) == [40, 100, 160, 220]


def test_a_huge_jpeg_is_read_reduced_and_told_in_its_own_pixels(tmp_path, monkeypatch):
    image = Image.fromarray(bars(20)).resize((1600, 1600), Image.Resampling.NEAREST)
    image.save(tmp_path / "a.jpg", quality=95)
    (whole,), _ = rows_of(tmp_path / "a.jpg")
    monkeypatch.setattr(pictures, "MAX_PIXELS", 900 * 900)
    picture = read_picture(tmp_path / "a.jpg")
    assert picture.bgr.shape == (800, 800, 3) and picture.reduced == 2 and picture.size == (1600, 1600)
    (reduced,), _ = rows_of(tmp_path / "a.jpg", drawn=tmp_path / "drawn.png")
    # The stand-in's face has a size of its own, and is twice as large in the picture as it is.
    assert reduced["box_width"] == pytest.approx(2 * whole["box_width"], abs=0.02)
    assert reduced["focal_px"] == whole["focal_px"]
    with pytest.raises(DataError, match=r"a\.jpg: a picture of more than 810,000 pixels \(1600 x 1600\)"):
        read_bgr(tmp_path / "a.jpg")  # where labels are of its own pixels
    monkeypatch.setattr(pictures, "MAX_REDUCED_PIXELS", 1000 * 1000)
    with pytest.raises(DataError, match=r"a\.jpg: a picture of more than 1,000,000 pixels"):
        read_picture(tmp_path / "a.jpg")
    image.save(tmp_path / "a.webp", lossless=True)  # whose reader needs all of it twice
    with pytest.raises(DataError, match=r"a\.webp: a picture of more than 810,000 pixels \(1600 x 1600\)"):
        read_picture(tmp_path / "a.webp")


@pytest.mark.parametrize("mode", ["L", "RGB", "RGBA", "P", "1", "I;16", "F", "CMYK"])
def test_a_huge_picture_is_read_reduced_band_by_band(mode, tmp_path, monkeypatch):
    monkeypatch.setattr(modes, "BAND", 5000)  # four lines of 34
    monkeypatch.setattr(Image, "MAX_IMAGE_PIXELS", 3000)  # as with one of 200 megapixels
    colours = np.kron(COLOUR[:34], np.ones((4, 4, 1), np.uint8))[:135, :255]
    image = Image.fromarray(colours)
    if mode == "RGBA":
        image.putalpha(0)
    elif mode == "I;16":
        image = Image.fromarray(colours[..., 0].astype(np.uint16) * 257)
    elif mode == "F":
        image = Image.fromarray(colours[..., 0] / np.float32(255))
    else:
        image = image.quantize(255) if mode == "P" else image.convert(mode)
    exif = Image.Exif()
    exif[0x0112] = 6
    for ending in {"F": ("tif",), "CMYK": ("tif",)}.get(mode, ("png", "tif")):
        path = tmp_path / f"a.{ending}"
        image.save(path, exif=exif)
        whole = read_bgr(path)
        with monkeypatch.context() as limit:
            limit.setattr(pictures, "MAX_PIXELS", 5000)
            picture = read_picture(path)
        assert (
            whole.shape == (255, 135, 3) and picture.bgr.shape == (64, 34, 3) and picture.size == (135, 255)
        )
        expected = Image.fromarray(whole).resize((34, 64), Image.Resampling.BOX)
        off = np.abs(picture.bgr - np.asarray(expected).astype(float)).mean()
        assert off < (8 if mode == "1" else 1.5)  # the last band has a scale of its own


def test_a_huge_picture_is_in_memory_once_and_a_bomb_is_refused(tmp_path):
    side = 4096
    Image.new("RGB", (side, side), (9, 90, 200)).save(tmp_path / "a.png", compress_level=1)
    parts = [(b"IHDR", struct.pack(">IIBBBBB", 1 << 20, 1 << 20, 8, 2, 0, 0, 0)), (b"IEND", b"")]
    chunks = (struct.pack(">I", len(d)) + n + d + struct.pack(">I", zlib.crc32(n + d)) for n, d in parts)
    (tmp_path / "bomb.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"".join(chunks))
    with pytest.raises(DataError, match=r"bomb\.png: .* \(1048576 x 1048576\); make it smaller"):
        read_picture(tmp_path / "bomb.png")
    program = (
        "import sys; from pathlib import Path\n"
        "from downstream_hpe.prediction import modes, pictures\n"
        "pictures.MAX_PIXELS, modes.BAND = 1 << 20, 1 << 20\n"
        "peak = lambda: int(Path('/proc/self/status').read_text().split('VmHWM:')[1].split()[0])\n"
        "before = peak()\n"
        "picture = pictures.read_picture(Path(sys.argv[1]) / 'a.png')\n"
        "print(*picture.bgr.shape, *picture.size, peak() - before)\n"
    )
    command = [sys.executable, "-c", program, str(tmp_path)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=100, check=True)
    *sizes, kilobytes = map(int, done.stdout.split())
    assert sizes == [side // 4, side // 4, 3, side, side] and done.stderr == ""
    # Pillow has four bytes a pixel; a band, and the reduced one, come on top.
    assert kilobytes < 1.9 * 4 * side * side / 1024


def test_what_is_no_picture(tmp_path):
    for name, content, says in (
        ("text.jpg", b"Dear Sir,\nthis is no picture\n", "not a readable picture; it holds text"),
        ("empty.jpg", b"", "not a readable picture; it is empty"),
        ("empty.mp4", b"", "cannot be opened as video; it is empty"),
        ("text.mp4", b"no video\n", "cannot be opened as video; it holds text"),
        ("none.png", b"\x89PNG\r\n\x1a\n" + bytes(99), "not a readable picture"),
        ("none.ppm", b"P6 0 0 255\n", "not a readable picture"),
        ("none.exr", b"v/1\x01" + bytes(99), "a picture of 0 x 0 pixels has none to look at"),
        ("none.tif", b"II*\0" + bytes(99), "not a readable"),
    ):
        (tmp_path / name).write_bytes(content)
        rows, (note,) = rows_of(tmp_path / name)
        assert not rows and note.startswith(f"{tmp_path / name}: {says}"), note
        assert "\n" not in note


def test_names_that_mean_nothing(tmp_path):
    for name in ("", "  "):
        with pytest.raises(
            UsageError, match="is no input; expected a picture, a video, a folder, an address"
        ):
            find_sources([name])
    Image.fromarray(bars(3)).save(tmp_path / "a.png")
    for name in ("o.gif", "o.heic", "o.pdf", "o.mov"):
        with pytest.raises(UsageError, match=r"takes a folder or a file \.bmp \.jpeg \.jpg \.png"):
            find_sources([str(tmp_path / "a.png")], Path(name))


def test_a_pipe_with_a_name_is_no_file(tmp_path):
    os.mkfifo(tmp_path / "a.jpg")
    with pytest.raises(UsageError, match=r"a\.jpg: neither a file nor a folder; what comes through a pipe"):
        find_sources([str(tmp_path / "a.jpg")])


def test_folders_take_what_names_do(tmp_path):
    """One list of endings: whatever a folder is searched for is read where it is named, and documented."""
    page = (ROOT / "docs" / "inputs.md").read_text(encoding="utf-8")
    assert not [ending for ending in sorted(MEDIA) if f"{ending} " not in page]
    assert set(DRAWN_PICTURES) < MEDIA
    for ending in MEDIA:
        (tmp_path / f"a{ending.upper()}").write_bytes(b"\xff")
    (tmp_path / "program.ts").write_text("export const a = 1")
    notes: list[str] = []
    found = find_sources([str(tmp_path)], leave_out=notes.append)
    assert {source.name.split(".")[-1].lower() for source in found} == {e[1:] for e in MEDIA} - {"ts", "mts"}
    assert "program.ts" in notes[0] or "a.TS" in notes[0]


def test_no_library_writes_to_the_terminal(tmp_path):
    """Profiles that are none, bombs by Pillow's count, palettes with transparency, tags that are odd."""
    image = Image.fromarray(quarters())
    image.save(tmp_path / "profile.png", icc_profile=b"none" * 9)
    image.save(tmp_path / "tags.tif", compression="tiff_lzw", tiffinfo={65000: "odd", 700: b"x"})
    palette = image.convert("P")
    palette.save(tmp_path / "palette.png", transparency=b"\x80" * 9)
    file = io.BytesIO()
    image.save(file, "JPEG")
    (tmp_path / "cut.jpg").write_bytes(file.getvalue()[:-200])
    cut_tiff = (tmp_path / "tags.tif").read_bytes()
    (tmp_path / "cut.tif").write_bytes(cut_tiff[: len(cut_tiff) // 2])
    program = (
        "import sys; from pathlib import Path; from PIL import Image\n"
        "from downstream_hpe.errors import DataError\n"
        "from downstream_hpe.prediction.pictures import read_bgr\n"
        "Image.MAX_IMAGE_PIXELS = 4000\n"
        "for name in sys.argv[1:]:\n"
        "    try: print(read_bgr(Path(name)).shape)\n"
        "    except DataError as error: print(error)\n"
    )
    files = sorted(map(str, tmp_path.iterdir()))
    command = [sys.executable, "-c", program, *files]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=100)
    assert done.stderr == "" and len(done.stdout.splitlines()) == len(files)
