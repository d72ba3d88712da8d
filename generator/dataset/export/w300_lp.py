# SPDX-License-Identifier: GPL-3.0-or-later
"""300W-LP: an image and a .mat of the same name, and lists of their names."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from scipy.io import savemat

from generator.dataset.export.options import NEEDS_POINTS, Format
from generator.dataset.export.sample import Sample
from generator.dataset.export.source import Source, require_images

ABOUT = """\
`<split>/<subject>_<expression>_<pose>.jpg` and `.mat`; `files.txt` lists the names without suffix (all
rows), `files_<split>.txt` those of one split. In a `.mat`:

| field | meaning |
|---|---|
| Pose_Para | float64 [1, 7]: pitch, yaw, roll in radians, tx, ty, tz, scale |
| pt2d | float64 [2, 68]: x, y in pixels; the centre of the first pixel is (0.5, 0.5) |
| pt3d_68 | float64 [3, 68]: x, y as pt2d; z in the same pixels, towards the viewer, 0 at the pivot |
| roi | int32 [1, 4]: the box of pt2d in whole pixels, x1 y1 x2 y2 |
| landmark_source | `exact` (anchored on the mesh) or `detected` (MediaPipe; its z has its own origin) |
| Rotation, Camera, Translation_mm | R_C, K and the pivot in the camera frame, exact |

R_U = Rx(-pitch) Ry(-yaw) Rz(-roll). tx, ty, tz and scale are 3DDFA's weak perspective taken at the pivot,
`scale * R_U X + t` with y from the bottom of the image, X in mm and tz = 0 by definition; with a real lens
it is an approximation, Camera and Translation_mm are exact. The 68 points are a fixed subset of the
dataset's landmarks; the jaw's lie on the mesh and not on the visible outline.
"""


def write(source: Source, folder: Path) -> str:
    """Write the export; returns what its README says about it.

    Raises UsageError: a row has no landmarks and missing = "fail". DatasetError: there are no images.
    """
    require_images(source, "300w-lp")
    names: dict[str, list[str]] = {}
    stems: dict[str, tuple[str, str]] = {}
    for sample in source.samples():
        stem = f"{sample.subject}_{sample.expression}"
        while stems.setdefault(stem, sample.head) != sample.head:
            stem += "~"  # expression b_c of subject a, and c of a_b
        name = f"{sample.split}/{stem}_{sample.pose}"
        (folder / sample.split).mkdir(exist_ok=True)
        (folder / f"{name}.jpg").write_bytes(sample.jpeg())
        mat = io.BytesIO()
        savemat(mat, mat_fields(sample), do_compression=True)
        (folder / f"{name}.mat").write_bytes(mat.getvalue())
        names.setdefault(sample.split, []).append(name)
    for split, listed in names.items():
        (folder / f"files_{split}.txt").write_text("\n".join(listed) + "\n", encoding="utf-8")
    every = [name for split in sorted(names) for name in names[split]]
    (folder / "files.txt").write_text("\n".join(every) + "\n", encoding="utf-8")
    return ABOUT


def mat_fields(sample: Sample) -> dict[str, object]:
    """What the .mat of one sample holds. The sample has points."""
    assert sample.points is not None
    points = sample.points.T
    yaw, pitch, roll = np.deg2rad(sample.angles_deg)
    pivot = sample.camera @ (sample.translation_mm / sample.translation_mm[2])
    scale = sample.camera[0, 0] / sample.translation_mm[2]
    pose = [pitch, yaw, roll, pivot[0], sample.height - pivot[1], 0.0, scale]
    low, high = np.floor(points[:2].min(axis=1)), np.ceil(points[:2].max(axis=1))
    return {
        "Pose_Para": np.array([pose]),
        "pt2d": points[:2],
        "pt3d_68": points * [[1.0], [1.0], [-1.0]],
        "roi": np.array([[*low, *high]]).astype(np.int32),
        "landmark_source": sample.points_from,
        "Rotation": sample.rotation,
        "Camera": sample.camera,
        "Translation_mm": sample.translation_mm[None],
    }


FORMAT = Format(
    write,
    readers="HopeNet, 6DRepNet, FSA-Net, 3DDFA …",
    holds="`.jpg` + `.mat` (Pose_Para, pt2d, pt3d_68, roi), `files.txt`",
    written="`Pose_Para[0, :3]` = pitch, yaw, roll, radians",
    back="D Rx(-pitch) Ry(-yaw) Rz(-roll) D",
    missing=NEEDS_POINTS,
    landmarks=True,
)
