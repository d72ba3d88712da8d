# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces of 64 x 64 pixels and their angles in one archive, as FSA-Net packs them."""

from __future__ import annotations

import shutil
import zipfile
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
from PIL import Image

from generator.dataset.export.boxes import BOX_ABOUT
from generator.dataset.export.options import Format
from generator.dataset.export.sample import Sample
from generator.dataset.export.source import Source, require_images
from generator.dataset.format.image import decode_image

SIZE = 64
MARGIN = 0.4
"""A face is cut out by so much of its box's width and height more on each side: FSA-Net's `--ad`."""
_YEAR_ONE = (1980, 1, 1, 0, 0, 0)
"""Of a zip file; two exports are the same bytes."""

ABOUT = f"""\
`<split>.npz`, which 6DRepNet's class BIWI, FSA-Net's training and `downstream-hpe evaluate --format biwi-npz`
read as it is:

| array | meaning |
|---|---|
| image | uint8 [N, {SIZE}, {SIZE}, 3], BGR: the face with {MARGIN:.0%} of its box more on each side |
| pose | float64 [N, 3]: yaw, pitch, roll in degrees, R_C = Rx(-pitch) Ry(yaw) Rz(roll) |
| img_size | {SIZE} |
| name | str [N], sample_id: which row, and so which head and licence |

FSA-Net looks for them as `data/BIWI_train.npz` and `data/BIWI_test.npz`. Like its own, a face that is not
square is squeezed. 6DRepNet trains on `300w-lp`; this is what its class BIWI reads.

{BOX_ABOUT} The whole image stands there then, which is so in {{unknown}} of {{rows}} rows. No landmarks, so a
row on which no face was found has an exact label all the same.
"""


@dataclass
class _Split:
    """The rows of one split so far; images are on the disk, since a million of them fill 12 GB."""

    images: BinaryIO
    poses: list[np.ndarray] = field(default_factory=list)
    names: list[str] = field(default_factory=list)


def write(source: Source, folder: Path) -> str:
    """Write the export; returns what its README says about it. Raises DatasetError: there are no images."""
    require_images(source, "fsanet-npz")
    splits: dict[str, _Split] = {}
    unknown = 0
    with ExitStack() as stack:
        for sample in source.samples():
            if sample.split not in splits:
                splits[sample.split] = _Split(stack.enter_context((folder / sample.split).open("w+b")))
            split = splits[sample.split]
            split.images.write(cropped(sample).tobytes())
            split.poses.append(sample.angles_deg)
            split.names.append(sample.sample_id)
            unknown += sample.box is None
        for name, split in splits.items():
            _archive(folder / f"{name}.npz", split)
            (folder / name).unlink()
    return ABOUT.format(unknown=unknown, rows=source.rows)


def cropped(sample: Sample) -> np.ndarray:
    """The face alone: uint8 [SIZE, SIZE, 3], BGR. Raises DatasetError: its image cannot be decoded."""
    image = decode_image(sample.image, f"the image of {sample.sample_id}").convert("RGB")
    place = (0.0, 0.0, float(image.width), float(image.height))
    if sample.box is not None:
        x1, y1, x2, y2 = sample.box.tolist()
        wide, high = MARGIN * (x2 - x1), MARGIN * (y2 - y1)
        inside = (max(x1 - wide, 0), max(y1 - high, 0), min(x2 + wide, place[2]), min(y2 + high, place[3]))
        if inside[2] - inside[0] >= 1 and inside[3] - inside[1] >= 1:  # a face may lie beyond the image
            place = inside
    small = image.resize((SIZE, SIZE), Image.Resampling.BILINEAR, box=place)
    return np.asarray(small)[..., ::-1]


def _archive(path: Path, split: _Split) -> None:
    count = len(split.poses)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        with archive.open(zipfile.ZipInfo("image.npy", _YEAR_ONE), "w", force_zip64=True) as file:
            shape = {"descr": "|u1", "fortran_order": False, "shape": (count, SIZE, SIZE, 3)}
            np.lib.format.write_array_header_1_0(file, shape)  # type: ignore[arg-type]
            split.images.seek(0)
            shutil.copyfileobj(split.images, file)
        rest = {"pose": np.array(split.poses), "img_size": np.array(SIZE), "name": np.array(split.names)}
        for name, values in rest.items():
            with archive.open(zipfile.ZipInfo(f"{name}.npy", _YEAR_ONE), "w", force_zip64=True) as file:
                np.lib.format.write_array(file, values, version=(1, 0), allow_pickle=False)


FORMAT = Format(
    write,
    readers="FSA-Net, 6DRepNet's class BIWI, `evaluate --format biwi-npz`",
    holds="`<split>.npz`: image (64 x 64, BGR), pose",
    written="`pose` = yaw, pitch, roll, degrees",
    back="Rx(-pitch) Ry(yaw) Rz(roll)",
    boxes=True,
)
