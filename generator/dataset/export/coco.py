# SPDX-License-Identifier: GPL-3.0-or-later
"""COCO keypoints: the 68 points of the face, one annotation an image."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from generator.dataset.export.options import NEEDS_POINTS, Format
from generator.dataset.export.sample import Sample
from generator.dataset.export.source import Source, require_images
from generator.landmarks.topology import PointSubset

VISIBLE, HIDDEN = 2, 1

ABOUT = """\
`annotations/<split>.json` and `images/<split>/…`. Every image has one annotation of the category `face` with
the 68 points of iBUG 300-W (the order of COCO-WholeBody's face), in pixels, the centre of the first pixel
being (0.5, 0.5). The flag of a point is COCO's: 2 visible, 1 labelled but hidden by the head or outside of
the image. Detected points are all flagged 2, because a detector does not say what is hidden.

Each annotation has fields that COCO readers ignore: `rotation` (R_C, nine numbers, row-major),
`angles_deg` (yaw, pitch, roll), `camera` (K), `translation_mm`, `detected`, `landmark_source`
(`exact` or `detected`).
"""


def write(source: Source, folder: Path) -> str:
    """Write the export; returns what its README says about it.

    Raises UsageError: a row has no landmarks and missing = "fail". DatasetError: there are no images.
    """
    require_images(source, "coco")
    (folder / "annotations").mkdir()
    images: dict[str, list[str]] = {}
    files: dict[str, TextIO] = {}
    with ExitStack() as stack:
        for number, sample in enumerate(source.samples(), start=1):
            name = f"{sample.subject}/{sample.expression}/{sample.pose}{sample.image_suffix}"
            path = folder / "images" / sample.split / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(sample.image)
            if sample.split not in files:
                opened = (folder / "annotations" / f"{sample.split}.json").open("w", encoding="utf-8")
                files[sample.split] = stack.enter_context(opened)
                opened.write(_opening(source.points))
                images[sample.split] = []
            listed = images[sample.split]
            # Streamed: a list of a million annotations would not fit into memory.
            files[sample.split].write((",\n" if listed else "\n") + json.dumps(annotation(sample, number)))
            size = {"width": sample.width, "height": sample.height}
            listed.append(json.dumps({"id": number, "file_name": name, "license": 1, **size}))
        for split, file in files.items():
            file.write('\n],\n"images": [\n' + ",\n".join(images[split]) + "\n]}\n")
    return ABOUT


def annotation(sample: Sample, number: int) -> dict[str, Any]:
    """The annotation of one sample, which has points. number: its id and its image's."""
    assert sample.points is not None
    image = sample.points[:, :2]
    low, size = image.min(axis=0), np.ptp(image, axis=0)
    if sample.visible is None or sample.points_from == "detected":
        flags = np.full(len(image), VISIBLE)
    else:
        flags = np.where(sample.visible, VISIBLE, HIDDEN)
    keypoints = [value for (x, y), flag in zip(image.tolist(), flags.tolist(), strict=True)
                 for value in (x, y, flag)]  # fmt: skip
    return {
        "id": number,
        "image_id": number,
        "category_id": 1,
        "iscrowd": 0,
        "bbox": [*low.tolist(), *size.tolist()],
        "area": float(size.prod()),
        "num_keypoints": len(image),
        "keypoints": keypoints,
        "rotation": sample.rotation.ravel().tolist(),
        "angles_deg": sample.angles_deg.tolist(),
        "camera": sample.camera.ravel().tolist(),
        "translation_mm": sample.translation_mm.tolist(),
        "detected": sample.detected,
        "landmark_source": sample.points_from,
    }


def _opening(points: PointSubset) -> str:
    category = {
        "id": 1,
        "name": "face",
        "supercategory": "person",
        "keypoints": points.names,
        "skeleton": [(a + 1, b + 1) for a, b in points.skeleton],  # COCO counts them from 1
    }
    info = {"description": "Head poses with exact labels, made with Headturn; see README.md"}
    licences = [{"id": 1, "name": "of each head, see README.md", "url": ""}]
    head = {"info": info, "licenses": licences, "categories": [category]}
    return json.dumps(head)[:-1] + ',\n"annotations": ['


FORMAT = Format(
    write,
    readers="keypoint toolkits",
    holds="68 keypoints with visibility, a JSON a split",
    written="`rotation`, nine numbers",
    back="as it stands",
    missing=NEEDS_POINTS,
    landmarks=True,
)
