# SPDX-License-Identifier: GPL-3.0-or-later
"""Text files as those of the Biwi Kinect Head Pose Database."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np

from generator.dataset.export.numbered import head_numbers, write_identities
from generator.dataset.export.options import Format
from generator.dataset.export.sample import Sample
from generator.dataset.export.source import Source, require_images

ABOUT = """\
`<NN>/frame_XXXXX_rgb.png` and `frame_XXXXX_pose.txt`, a folder a head (`identities.csv` says which),
`<NN>/rgb.cal` with K, and `files.txt` with names such as `01/frame_00003`.

A pose file has the 3 x 3 matrix, an empty line, and the pivot of the head in the camera frame in mm. The
matrix in the file is R_C. The usual readers (HopeNet, FSA-Net, 6DRepNet) **transpose** what they read and
then take M = R_C^T: roll = -atan2(M10, M00), yaw = -atan2(-M20, hypot(M21, M22)), pitch = atan2(M21, M22);
these are the angles of this dataset. There is no depth image. No landmarks, so a row on which no face
was found has an exact label all the same.
"""


def write(source: Source, folder: Path) -> str:
    """Write the export; returns what its README says about it. Raises DatasetError: there are no images."""
    require_images(source, "biwi")
    numbers = head_numbers(source.heads, keep_numbers=False)
    frames: Counter[tuple[str, str]] = Counter()
    names = []
    for sample in source.samples():
        home = folder / f"{numbers[sample.head]:02d}"
        if not frames[sample.head]:
            home.mkdir()
            (home / "rgb.cal").write_text(_calibration(sample), encoding="ascii")
        frames[sample.head] += 1
        frame = f"frame_{frames[sample.head]:05d}"
        (home / f"{frame}_rgb.png").write_bytes(sample.png())
        pose = f"{_lines(sample.rotation)}\n\n{_lines(sample.translation_mm)}\n"
        (home / f"{frame}_pose.txt").write_text(pose, encoding="ascii")
        names.append(f"{home.name}/{frame}")
    (folder / "files.txt").write_text("\n".join(names) + "\n", encoding="ascii")
    write_identities(source.heads, numbers, folder)
    return ABOUT


def _lines(numbers: np.ndarray) -> str:
    return "\n".join(" ".join(f"{value:.12f}" for value in row) for row in np.atleast_2d(numbers).tolist())


def _calibration(sample: Sample) -> str:
    """Intrinsics, distortion, rotation and translation to the depth camera, size: the layout of rgb.cal."""
    blocks = [_lines(sample.camera), "0 0 0 0", _lines(np.eye(3)), "0 0 0", f"{sample.width} {sample.height}"]
    return "\n\n".join(blocks) + "\n"


FORMAT = Format(
    write,
    readers="readers of the Biwi Kinect database",
    holds="`frame_XXXXX_pose.txt`, `_rgb.png`, `rgb.cal`",
    written="the matrix in the file is R_C",
    back="as it stands",
)
