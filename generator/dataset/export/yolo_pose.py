# SPDX-License-Identifier: GPL-3.0-or-later
"""YOLO pose: a box and the 68 points of the face, a line of text an image."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from generator.dataset.export.boxes import BOX_ABOUT
from generator.dataset.export.options import NEEDS_POINTS, Format
from generator.dataset.export.sample import Sample
from generator.dataset.export.source import Source, require_images
from generator.landmarks.topology import PointSubset, Topology

VISIBLE, HIDDEN, OUTSIDE = 2, 1, 0
_KEYS = {"train": "train", "validation": "val"}
"""What data.yaml calls a split; others keep their names."""

ABOUT = f"""\
`images/<split>/NNNNNNNN.png` or `.jpg`, `labels/<split>/NNNNNNNN.txt` of the same name, and `data.yaml` with
`kpt_shape`, `flip_idx` and the names of the points: `yolo pose train data=TARGET/data.yaml`. `poses.jsonl`
says for each file which row it is, its head's licence, and its pose: `rotation` (R_C, nine numbers,
row-major), `angles_deg` (yaw, pitch, roll), `landmark_source` (`exact` or `detected`).

A label is one line: the class, 0; the middle, width and height of the box; and 68 times x, y and a flag. All
are shares of the image's width and height, so that 0 and 1 are its edges. The flag is 2 for a visible point,
1 for one that the head hides, and 0, with x = y = 0, for one outside of the image. Detected points are all 2,
because a detector does not say what is hidden. The box ends where the image does; where a face lies outside
of its image, the label is empty. {BOX_ABOUT}
"""


def write(source: Source, folder: Path) -> str:
    """Write the export; returns what its README says about it.

    Raises UsageError: a row has no landmarks and missing = "fail". DatasetError: there are no images.
    """
    require_images(source, "yolo-pose")
    licences = {(head.subject, head.expression): head.license for head in source.heads}
    splits: set[str] = set()
    with (folder / "poses.jsonl").open("w", encoding="utf-8") as poses:
        for number, sample in enumerate(source.samples(), start=1):
            if sample.split not in splits:
                for kind in ("images", "labels"):
                    (folder / kind / sample.split).mkdir(parents=True)
                splits.add(sample.split)
            name = f"{number:08d}"
            image = f"images/{sample.split}/{name}{sample.image_suffix}"
            (folder / image).write_bytes(sample.image)
            (folder / "labels" / sample.split / f"{name}.txt").write_text(label(sample), encoding="ascii")
            fact = {
                "image": image,
                "sample_id": sample.sample_id,
                "license": licences[sample.head],
                "rotation": sample.rotation.ravel().tolist(),
                "angles_deg": sample.angles_deg.tolist(),
                "landmark_source": sample.points_from,
            }
            poses.write(json.dumps(fact) + "\n")
    (folder / "data.yaml").write_text(
        data_yaml(sorted(splits), source.points, flip_idx(source.topology)), encoding="utf-8"
    )
    return ABOUT


def label(sample: Sample) -> str:
    """The line of one sample, which has points; "" where its face lies outside of its image: a background."""
    assert sample.points is not None
    size = np.array([sample.width, sample.height], dtype=np.float64)
    points = sample.points[:, :2] / size
    ends = np.array([points.min(axis=0), points.max(axis=0)])  # of heads with few other points
    low, high = np.clip(ends if sample.box is None else sample.box.reshape(2, 2) / size, 0, 1)
    if (high <= low).any():
        return ""
    inside = ((points >= 0) & (points <= 1)).all(axis=1)
    if sample.visible is None or sample.points_from == "detected":
        flags = np.full(len(points), VISIBLE)
    else:
        flags = np.where(sample.visible, VISIBLE, HIDDEN)
    flags[~inside] = OUTSIDE
    words = ["0", *(f"{value:.8f}" for value in (*((low + high) / 2), *(high - low)))]
    for (x, y), flag in zip(np.where(inside[:, None], points, 0.0), flags, strict=True):
        words += [f"{x:.8f}", f"{y:.8f}", str(flag)]
    return " ".join(words) + "\n"


def flip_idx(topology: Topology) -> list[int]:
    """Which of the 68 points each one becomes in a mirror."""
    assert topology.ibug_68 is not None
    chosen = topology.ibug_68.indices.tolist()
    return [chosen.index(partner) for partner in topology.mirror_pairs()[chosen].tolist()]


def data_yaml(splits: list[str], points: PointSubset, flipped: list[int]) -> str:
    """data.yaml. Paths count from where it lies, so that the folder may be moved."""
    keys = {_KEYS.get(split, split): f"images/{split}" for split in splits}
    lines = [f"{key}: {json.dumps(path)}" for key, path in keys.items()]
    absent = [key for key in _KEYS.values() if key not in keys]
    lines += [f"# {key}: ultralytics wants it, and no row is in that split" for key in absent]
    lines += [
        f"kpt_shape: [{len(points.names)}, 3]",
        f"flip_idx: {flipped}",
        "names: {0: face}",
        f"kpt_names: {{0: {json.dumps(points.names)}}}",
    ]
    return "\n".join(lines) + "\n"


FORMAT = Format(
    write,
    readers="ultralytics (`yolo pose train`)",
    holds="`images/`, `labels/`, `data.yaml`: a box and 68 keypoints",
    written="`rotation` of `poses.jsonl`, nine numbers",
    back="as it stands",
    missing=NEEDS_POINTS,
    landmarks=True,
    boxes=True,
)
