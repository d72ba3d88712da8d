# SPDX-License-Identifier: GPL-3.0-or-later
"""What webdataset and tfrecord say about a row beside its image, as plain values."""

from __future__ import annotations

from typing import Any

from generator.dataset.export.boxes import BOX_ABOUT
from generator.dataset.export.sample import Sample
from generator.dataset.export.source import Source

RECORD_ABOUT = f"""\
| field | meaning |
|---|---|
| sample_id, subject, expression, split | which row it is |
| license, redistributable | of its head, and whether renders of it may be published |
| rotation | R_C, nine numbers, row-major |
| angles_deg | yaw, pitch, roll |
| camera, translation_mm | K, nine numbers, and the pivot in the camera frame |
| width, height | of the image in pixels |
| detected | did the detector find the face? |
| box | x1, y1, x2, y2 in pixels; it may reach beyond the image |
| landmarks | the 68 points of iBUG 300-W: x, y, z in pixels, 204 numbers |
| landmark_source | `exact` or `detected`; empty where the row has no landmarks |
| visible | 68 numbers, 0 for a point that the head hides; only of exact landmarks |

A row without landmarks or a box has no such field. {BOX_ABOUT}
"""


class Records:
    """The records of one source's rows."""

    def __init__(self, source: Source) -> None:
        self._heads = {(head.subject, head.expression): head for head in source.heads}

    def of(self, sample: Sample) -> dict[str, Any]:
        """Text, numbers, flags and flat lists of numbers by the names of :data:`RECORD_ABOUT`."""
        head = self._heads[sample.head]
        record: dict[str, Any] = {
            "sample_id": sample.sample_id,
            "subject": sample.subject,
            "expression": sample.expression,
            "split": sample.split,
            "license": head.license,
            "redistributable": head.redistributable,
            "rotation": sample.rotation.ravel().tolist(),
            "angles_deg": sample.angles_deg.tolist(),
            "camera": sample.camera.ravel().tolist(),
            "translation_mm": sample.translation_mm.tolist(),
            "width": sample.width,
            "height": sample.height,
            "detected": sample.detected,
            "landmark_source": sample.points_from,
        }
        if sample.box is not None:
            record["box"] = sample.box.tolist()
        if sample.points is not None:
            record["landmarks"] = sample.points.ravel().tolist()
        if sample.visible is not None and sample.points_from == "exact":
            record["visible"] = sample.visible.astype(int).tolist()
        return record
