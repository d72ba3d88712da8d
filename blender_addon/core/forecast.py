# SPDX-License-Identifier: GPL-3.0-or-later
"""How much a build will be, before it is started: images, time and space, and what that rests on."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from generator.errors import HeadturnError
from generator.heads.head import is_scene
from generator.plan.head_source import is_made
from generator.plan.settings import Values
from generator.plan.variety import NONE

from .build import Build
from .found import Listing
from .grid import NotDrawn, plan_poses
from .progress import duration
from .tables import section_of

MB = 10**6
ENOUGH = 100
"""Images without which starting up is most of what a build took."""

PER_CORE_S = {"fast": 28.0, "quality": 6.5}
"""Images a second and core where nothing is known of this machine: benchmarks/history.csv has them of two."""
IMAGE_BYTES, ROW_BYTES, GUESSED_PIXELS = 35_000.0, 10_000.0, 256**2
"""Of an image of so many pixels, and of its row."""
VARIED_TIME, VARIED_BYTES = 2.0, 2.0
"""How much more an image is that is varied."""


@dataclass(frozen=True)
class Rate:
    """What a build came to. row_bytes: of tables, whatever the resolution. like: settings that decide it."""

    per_s: float
    image_bytes: float
    row_bytes: float
    pixels: int
    like: str


@dataclass(frozen=True)
class Amount:
    """heads: None where nobody has looked."""

    heads: int | None
    poses: int
    twins: float

    @property
    def images(self) -> int:
        """Of all heads, or of one where their number is not known."""
        return round((self.heads or 1) * self.poses * (1 + self.twins))

    def line(self) -> str:
        """Such as "3 heads x 693 poses = 2,079 images"."""
        twins = f", with {self.twins:g} twin{'s' * (self.twins != 1)} each," if self.twins else ""
        images = _counted(self.images, "image")
        if self.heads is None:
            return f"{images} a head{twins}; Load Heads counts the heads"
        return f"{_counted(self.heads, 'head')} x {_counted(self.poses, 'pose')}{twins} = {images}"


def amount(values: Values, listing: Listing) -> Amount | None:
    """How much the configuration asks for; None if its poses make no sense, which is said beside them.

    values: with absolute paths. listing: the heads of its source, as far as they were listed.
    """
    heads, poses, dataset = (section_of(values, name) for name in ("heads", "poses", "dataset"))
    try:
        count = len(plan_poses(poses, ("", "")))
    except NotDrawn:
        count = poses.count
    except HeadturnError:
        return None
    known = len(listing.heads) or None
    if known is None and is_made(heads.source) and not heads.subjects and not heads.expressions:
        known = heads.count * (1 + heads.sampled_expressions)
    return Amount(known, count, len(dataset.twins) * dataset.twins_share)


def likeness(values: Values, workers: int) -> tuple[str, int]:
    """(settings that decide what an image costs, pixels of an image)."""
    render, dataset = (section_of(values, name) for name in ("render", "dataset"))
    kept = [values.get("render", {}), list(dataset.passes), dataset.images, dataset.image_format, workers]
    return json.dumps(kept, sort_keys=True, default=str), render.resolution**2


def guess(values: Values, workers: int) -> Rate | None:
    """What a build may come to where none was yet; None of a scene, whose engine has its own speed."""
    if is_scene(section_of(values, "heads").source):
        return None
    render = section_of(values, "render")
    varied = render.variety != NONE
    per_s = PER_CORE_S[render.preset] * (workers or os.cpu_count() or 1) / (VARIED_TIME if varied else 1)
    return Rate(per_s, IMAGE_BYTES * (VARIED_BYTES if varied else 1), ROW_BYTES, GUESSED_PIXELS, "")


def forecast(much: Amount, like: str, pixels: int, last: Rate | None) -> str:
    """Time and space, and what they rest on; "" where nothing is known."""
    if last is None or not last.per_s:
        return ""
    scale = pixels / last.pixels
    seconds = much.images / last.per_s * scale
    size = much.images * (last.image_bytes * scale + last.row_bytes) / MB
    space = f"{size / 1000:,.1f} GB" if size >= 1000 else f"{max(size, 1):,.0f} MB"
    time = f"{max(seconds, 1):.0f} s" if seconds < 100 else duration(seconds)
    if not last.like:
        return f"roughly {time}, {space}; better known after a first build"
    other = "" if like == last.like else ", which had other settings"
    return f"about {time}, {space}, at the rate of your last build{other}"


def rate_of(build: Build, like: str, pixels: int) -> Rate | None:
    """What a build that went well came to; None if it rendered too little to tell."""
    progress = build.progress
    if build.out is None or progress.result is None or progress.rendered < ENOUGH:
        return None
    rows = progress.result["rows"]
    tables = sum(_sizes(build.out / "data"))
    files = _sizes(build.newest.parent) if build.newest is not None else []
    size = sum(files) / max(len(files), 1)
    return Rate(progress.render_rate, size, tables / max(rows, 1), pixels, like)


def save(rate: Rate, file: Path) -> None:
    """Keep it for the next forecast."""
    file.write_text(json.dumps(asdict(rate)), encoding="utf-8")


def load(file: Path) -> Rate | None:
    """None if there is none, or none that can be read."""
    try:
        told: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
        sizes = float(told["image_bytes"]), float(told["row_bytes"])
        return Rate(float(told["per_s"]), *sizes, int(told["pixels"]), str(told["like"]))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _counted(number: int, what: str) -> str:
    return f"{number:,} {what}{'s' * (number != 1)}"


def _sizes(folder: Path) -> list[int]:
    found = []
    for path, _, names in os.walk(folder):
        found += [os.stat(os.path.join(path, name)).st_size for name in names]
    return found
