# SPDX-License-Identifier: GPL-3.0-or-later
"""Text files as those of the Biwi Kinect Head Pose Database."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from generator.dataset.export.boxes import BOX_ABOUT
from generator.dataset.export.numbered import head_numbers, write_identities
from generator.dataset.export.options import Format
from generator.dataset.export.sample import Sample
from generator.dataset.export.source import Source, require_images

ABOUT = """\
`<split>/<NN>/frame_XXXXX_rgb.png`, `frame_XXXXX_pose.txt` and `dockerface-frame_XXXXX_rgb.txt`: a folder a
split, and in it a folder a head (`identities.csv` says which); `<NN>/rgb.cal` with K, and `<split>/files.txt`
with names such as `01/frame_00003`. For HopeNet, a split is its data_dir and `files.txt` its filename_list.

A pose file has the 3 x 3 matrix, an empty line, and the pivot of the head in the camera frame in mm. The
matrix in the file is R_C. The usual readers (HopeNet, FSA-Net, 6DRepNet) **transpose** what they read and
then take M = R_C^T: roll = -atan2(M10, M00), yaw = -atan2(-M20, hypot(M21, M22)), pitch = atan2(M21, M22);
these are the angles of this dataset. There is no depth image. No landmarks, so a row on which no face
was found has an exact label all the same.

A dockerface file is what HopeNet crops by: the number of the frame, x1 y1 x2 y2 in pixels, and a score of 1.
{boxes} HopeNet then takes the whole image: the file is empty ({unknown} of {rows} are).

FSA-Net's script is not for this folder: it opens 24 heads, `01` to `24`, and takes every text in them for a
pose, the dockerface files, too.
"""


def write(source: Source, folder: Path) -> str:
    """Write the export; returns what its README says about it. Raises DatasetError: there are no images."""
    require_images(source, "biwi")
    numbers = head_numbers(source.heads, keep_numbers=False)
    frames: Counter[tuple[str, str]] = Counter()
    names: dict[str, list[str]] = {}
    unknown = 0
    for sample in source.samples():
        home = folder / sample.split / f"{numbers[sample.head]:02d}"
        if not frames[sample.head]:
            home.mkdir(parents=True)
            (home / "rgb.cal").write_text(_calibration(sample), encoding="ascii")
        frames[sample.head] += 1
        frame = f"frame_{frames[sample.head]:05d}"
        (home / f"{frame}_rgb.png").write_bytes(sample.png())
        pose = f"{_lines(sample.rotation)}\n\n{_lines(sample.translation_mm)}\n"
        (home / f"{frame}_pose.txt").write_text(pose, encoding="ascii")
        box = "" if sample.box is None else f"{frames[sample.head]} {_lines(sample.box)} 1.0\n"
        (home / f"dockerface-{frame}_rgb.txt").write_text(box, encoding="ascii")
        unknown += not box
        names.setdefault(sample.split, []).append(f"{home.name}/{frame}")
    for split, listed in names.items():
        (folder / split / "files.txt").write_text("\n".join(listed) + "\n", encoding="ascii")
    write_identities(source.heads, numbers, folder)
    return ABOUT.format(boxes=BOX_ABOUT, unknown=unknown, rows=source.rows)


def _lines(numbers: np.ndarray) -> str:
    return "\n".join(" ".join(f"{value:.12f}" for value in row) for row in np.atleast_2d(numbers).tolist())


def _calibration(sample: Sample) -> str:
    """Intrinsics, distortion, rotation and translation to the depth camera, size: the layout of rgb.cal."""
    blocks = [_lines(sample.camera), "0 0 0 0", _lines(np.eye(3)), "0 0 0", f"{sample.width} {sample.height}"]
    return "\n\n".join(blocks) + "\n"


FORMAT = Format(
    write,
    readers="HopeNet and other readers of the Biwi Kinect database",
    holds="`frame_XXXXX_pose.txt`, `_rgb.png`, HopeNet's boxes, `rgb.cal`",
    written="the matrix in the file is R_C",
    back="as it stands",
    boxes=True,
)
