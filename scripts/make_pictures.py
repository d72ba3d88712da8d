# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of docs/images, made anew with the code as it is.

    python scripts/make_pictures.py                     # all that this machine can make, about ten minutes
    python scripts/make_pictures.py steps.jpg looks.jpg
    python scripts/make_pictures.py ict_heads.jpg --ict ICT-FaceKit
    python scripts/make_pictures.py --list

Look at each before it is committed. What is not made here is in ELSEWHERE, with where it comes from.
"""

from __future__ import annotations

import argparse
import io
import json
import os
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
sys.path[:0] = [str(ROOT), str(ROOT / "scripts"), str(ROOT / "tests" / "downstream_hpe")]

ELSEWHERE = {
    "heads_before.jpg": "MakeHuman's own shapes; made by scripts/head_sheet.py before commit 08ff980",
    **dict.fromkeys(
        (f"blender_{name}.png" for name in ("build", "heads", "landmarks", "looks", "selected", "timeline")),
        "Blender's window: make screenshots",
    ),
}
"""Pictures of docs/images that no function below makes."""

QUALITY = 88


class Studio:
    """A scratch folder, with datasets that several pictures show. ict: a copy of ICT-FaceKit."""

    def __init__(self, folder: Path, ict: Path | None) -> None:
        self.folder, self.ict = folder, ict

    def run(self, *command: object, module: str = "generator.cli") -> None:
        """Run one of our commands in the folder."""
        words = [sys.executable, "-m", module, *map(str, command)]
        path = {**os.environ, "PYTHONPATH": str(ROOT)}
        subprocess.run(words, cwd=self.folder, env=path, check=True, stdout=subprocess.DEVNULL)

    def script(self, name: str, *arguments: object) -> None:
        """Run a script beside this one."""
        words = [sys.executable, str(ROOT / "scripts" / name), *map(str, arguments)]
        subprocess.run(words, cwd=self.folder, env={**os.environ, "PYTHONPATH": str(ROOT)}, check=True)

    def dataset(self, name: str, options: str) -> Path:
        """A dataset that is built once."""
        if not (self.folder / name).exists():
            self.run("build", *options.split(), "--out", name)
        return self.folder / name

    def demo(self) -> Path:
        """The dataset of make demo."""
        return self.dataset("demo", "--count 4 --yaw=-50,50,25 --pitch=-40,40,20 --roll=-30,30,30")

    def browser(self, *flags: str):
        """Chromium."""
        from browser import Browser

        return Browser(Path(tempfile.mkdtemp(dir=self.folder)), *flags)


def contact_sheet(studio: Studio, out: Path) -> None:
    """The sheet of the demo."""
    out.write_bytes((studio.demo() / "contact_sheet.png").read_bytes())


def report(studio: Studio, out: Path) -> None:
    """The upper part of the demo's report."""
    studio.run("report", studio.demo())
    with studio.browser() as browser:
        browser.open((studio.demo() / "report.html").as_uri(), 1400, 2460)
        browser.wait("document.readyState == 'complete'")
        _save(_shot(browser, studio, 900), out)


def variety_report(studio: Studio, out: Path) -> None:
    """What varies, in a report."""
    varied = studio.dataset("varied", "--count 16 --poses sobol:15 --variety photo --yaw=-50,50")
    studio.run("report", varied)
    with studio.browser() as browser:
        browser.open((varied / "report.html").as_uri(), 1400, 1800)
        browser.wait("document.readyState == 'complete'")
        find = "[...document.querySelectorAll('h2')].find(title => title.textContent == 'What varies')"
        browser.run(f"{find}.scrollIntoView(), window.scrollBy(0, -20)")
        _save(_shot(browser, studio, 1008), out)


def variety(studio: Studio, out: Path) -> None:
    """48 images of --variety photo, a head each."""
    options = "--count 48 --seed 3 --poses sobol:1 --variety photo --yaw=-40,40 --pitch=-30,30 --roll=-20,20"
    people = studio.dataset("people", options)
    tiles = [_tile(path, 160) for path in sorted((people / "images").rglob("*.png"))]
    _save(_grid(tiles, 8), out)


def looks(studio: Studio, out: Path) -> None:
    """One head at one pose, in nine looks."""
    studio.run("heads", "make", "--count", 4, "--seed", 0, "--out", "heads")
    tiles = []
    for seed in range(7, 16):
        options = (
            f"--pose 20,-5,0 --variety photo --preset fast --resolution 256 --no-landmarks --seed {seed}"
        )
        studio.run("preview", "heads/s0p0003", *options.split(), "--out", f"look{seed}.png")
        tile = _tile(studio.folder / f"look{seed}.png", 256)
        ImageDraw.Draw(tile).text(
            (6, 234), str(seed), "white", ImageFont.load_default(17), stroke_width=1, stroke_fill="black"
        )
        tiles.append(tile)
    _save(_grid(tiles, 3), out)


def predict(studio: Studio, out: Path) -> None:
    """Five renders with the poses that the shipped model reads in them."""
    poses = ((-35, -20, -10), (-15, 20, 10), (0, 0, 0), (25, -15, 20), (65, 5, 5))
    studio.run("heads", "make", "--count", 5, "--seed", 21, "--out", "five")
    heads = sorted(path.name for path in (studio.folder / "five").iterdir() if path.is_dir())
    for k, (head, pose) in enumerate(zip(heads, poses, strict=True)):
        options = f"--pose={','.join(map(str, pose))} --resolution 300 --no-landmarks --out view{k}.png"
        studio.run("preview", f"five/{head}", *options.split())
    for k in range(len(poses)):
        studio.run("predict", f"view{k}.png", "--draw", f"drawn{k}.png", module="downstream_hpe.cli")
    _save(_grid([_tile(studio.folder / f"drawn{k}.png", 300) for k in range(len(poses))], 5), out)


def steps(studio: Studio, out: Path) -> None:
    """One pose from a head's file to its row."""
    from make_steps import story

    options = "--count 1 --seed 3 --yaw=0,30,30 --pitch=-10,0,10 --roll=0,15,15 --passes depth,normal"
    _save(story(studio.dataset("one", f"{options} --resolution 384")), out)


def demo(studio: Studio, out: Path) -> None:
    """The page of downstream-hpe demo, with a render before its camera."""
    studio.run("heads", "make", "--count", 1, "--seed", 1, "--out", "shown")
    [head] = [path for path in (studio.folder / "shown").iterdir() if path.is_dir()]
    studio.run(
        "preview", head, *["--pose=-30,10,0", "--resolution", "360", "--no-landmarks", "--out", "shown.png"]
    )
    frame = Image.new("YCbCr", (640, 480), (90, 128, 128))
    frame.paste(Image.open(studio.folder / "shown.png").convert("YCbCr"), (140, 60))
    y, u, v = (np.asarray(plane) for plane in frame.split())
    pixels = b"".join(np.ascontiguousarray(p).tobytes() for p in (y, u[::2, ::2], v[::2, ::2]))
    camera = studio.folder / "camera.y4m"
    camera.write_bytes(b"YUV4MPEG2 W640 H480 F10:1 Ip A1:1 C420jpeg\n" + 20 * (b"FRAME\n" + pixels))
    command = [sys.executable, "-m", "downstream_hpe.cli", "demo", "--port", "0", "--json"]
    flags = ("--use-fake-device-for-media-stream", "--use-fake-ui-for-media-stream")
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        address = json.loads(server.stdout.readline())["url"]
        with studio.browser(*flags, f"--use-file-for-fake-video-capture={camera}") as browser:
            browser.open(address, 1280, 780)
            browser.wait("document.body?.dataset.state === 'ready' && document.readyState === 'complete'")
            browser.run("document.getElementById('camera').click()")
            browser.wait("document.getElementById('numbers').dataset.pose")
            _save(_shot(browser, studio, 1280), out)
        server.send_signal(signal.SIGINT)


def ict_heads(studio: Studio, out: Path) -> None:
    """Twelve heads of a copy of ICT-FaceKit, each from three sides."""
    from head_sheet import faces, sheet

    source = f"ict:{studio.ict}"
    studio.run("heads", "make", "--source", source, "--count", 12, "--seed", 2, "--out", "ict")
    seen = faces(studio.folder / "ict", [(0.0, 0.0, 0.0), (-40.0, 0.0, 0.0), (40.0, 0.0, 0.0)], 128)
    _save(Image.fromarray(sheet([tile for head in seen for tile in head], 9)), out)


def twins(studio: Studio, out: Path) -> None:
    """Rows and their twins."""
    factors = "glasses,hair,mask,light,lens,headwear,blur,noise"
    paired = studio.dataset("twins", f"--count 6 --seed 4 --poses sobol:2 --yaw=-30,30 --twins {factors}")
    studio.script("twin_sheet.py", paired, out, "--rows", 5, "--side", 130)


def heads_after(studio: Studio, out: Path) -> None:
    """48 parametric heads."""
    studio.script("head_sheet.py", out, "--count", 48, "--seed", 5, "--pixels", 140)


def skin(studio: Studio, out: Path) -> None:
    """Heads as paint alone, and as surfaces that answer light."""
    studio.script("skin_sheet.py", out)


def worn(studio: Studio, out: Path) -> None:
    """Every style of what heads wear."""
    kinds = "none glasses:all headwear:all mask:all headphones:all occluder:all"
    options = f"--wear {kinds} --count 2 --seed 5 --yaw -20 --pixels 128 --columns 12"
    studio.script("wear_sheet.py", out, *options.split())


PICTURES: dict[str, Callable[[Studio, Path], None]] = {
    "contact_sheet.png": contact_sheet,
    "steps.jpg": steps,
    "report.png": report,
    "predict.jpg": predict,
    "demo.jpg": demo,
    "looks.jpg": looks,
    "variety.jpg": variety,
    "variety_report.jpg": variety_report,
    "twins.jpg": twins,
    "skin.jpg": skin,
    "worn.jpg": worn,
    "heads_after.jpg": heads_after,
    "ict_heads.jpg": ict_heads,
}


def _tile(path: Path, side: int) -> Image.Image:
    return Image.open(path).convert("RGB").resize((side, side), Image.Resampling.LANCZOS)


def _grid(tiles: list[Image.Image], columns: int) -> Image.Image:
    width, height = tiles[0].size
    sheet = Image.new("RGB", (columns * width, -(-len(tiles) // columns) * height), "#808080")
    for k, tile in enumerate(tiles):
        sheet.paste(tile, (k % columns * width, k // columns * height))
    return sheet


def _shot(browser, studio: Studio, width: int) -> Image.Image:
    browser.screenshot(studio.folder / "shot.png")
    shot = Image.open(io.BytesIO((studio.folder / "shot.png").read_bytes())).convert("RGB")
    return shot.resize((width, round(shot.height * width / shot.width)), Image.Resampling.LANCZOS)


def _save(picture: Image.Image, out: Path) -> None:
    picture.save(out, quality=QUALITY)


def main() -> None:
    """Make the pictures that were asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("names", nargs="*", choices=[*PICTURES, []], metavar="NAME", help="; ".join(PICTURES))
    parser.add_argument("--ict", type=Path, help="a copy of ICT-FaceKit")
    parser.add_argument("--out", type=Path, default=IMAGES)
    parser.add_argument("--list", action="store_true", help="say which there are")
    given = parser.parse_args()
    if given.list:
        for name in PICTURES:
            print(f"{name}: {(PICTURES[name].__doc__ or '').strip()}")
        for name, reason in ELSEWHERE.items():
            print(f"{name}: not made here: {reason}")
        return
    with tempfile.TemporaryDirectory() as folder:
        studio = Studio(Path(folder), given.ict and given.ict.resolve())
        for name in given.names or PICTURES:
            if name == "ict_heads.jpg" and given.ict is None:
                print(f"{name}: left as it is; --ict FOLDER makes it")
                continue
            PICTURES[name](studio, (given.out / name).resolve())
            print(f"{name}: made")


if __name__ == "__main__":
    main()
