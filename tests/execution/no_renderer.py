# SPDX-License-Identifier: GPL-3.0-or-later
"""An executor that renders nothing, so that everything else of a build can be tried in no time.

Its parts come from the real writer; every image is a plain colour and every face has the same landmarks.
For the tests, and for benchmarks/scale.py.
"""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import cast

import numpy as np
from PIL import Image

from generator.content import content_versions
from generator.dataset.format.columns import ImageMode, further_column
from generator.dataset.format.files import check_there
from generator.dataset.format.part import commit_unit
from generator.dataset.format.schema import part_schema
from generator.dataset.format.unit_rows import UnitRows
from generator.errors import HeadError, WorkerError
from generator.execution.lanes.options import OnImage
from generator.execution.lanes.slot import ATTEMPTS, Outcome
from generator.heads.head import Head
from generator.heads.placement import Placement
from generator.landmarks.anchors import Anchors, no_anchors
from generator.landmarks.topology import FACE_MESH
from generator.messages import (
    BuildOrder,
    Built,
    HeadFacts,
    LaneOrder,
    Placed,
    PlaceOrder,
    Receipt,
    Shared,
    ShareOrder,
    Versions,
    VersionsOrder,
)
from generator.plan.views import View

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


class NoRenderer:
    """See :class:`generator.execution.executors.executor.Executor`.

    built, placed: the orders it carried out.
    versions: of its lanes; None for those of this installation.
    bad_heads: reasons by "subject/expression" why a head cannot be built.
    before: called with every order first. It may raise HeadError or WorkerError, which become the outcome
        as in a real executor, or what ends a build.
    """

    name, workers = "none", 1

    def __init__(self, versions: Mapping[str, str] | None = None, anchors: Anchors | None = None) -> None:
        self.built: list[BuildOrder] = []
        self.placed: list[PlaceOrder] = []
        self.versions = versions
        self.bad_heads: dict[str, str] = {}
        self._anchors = anchors or no_anchors(FACE_MESH)

    def before(self, order: LaneOrder) -> None:
        """Nothing; tests put something else in its place."""

    def run(self, orders: Sequence[LaneOrder], on_image: OnImage) -> Iterator[Outcome]:
        """See generator.execution.executors.executor.Executor."""
        for order in orders:
            try:
                self.before(order)
                yield Outcome(order, self._receipt(order, on_image))
            except HeadError as error:
                yield Outcome(order, None, str(error))
            except WorkerError as error:
                yield Outcome(order, None, str(error), ATTEMPTS, error.log)

    def close(self) -> None:
        """Nothing was started."""

    def _receipt(self, order: LaneOrder, on_image: OnImage) -> Receipt:
        if isinstance(order, VersionsOrder):
            return Versions(self._versions())
        if isinstance(order, PlaceOrder):
            self.placed.append(order)
            placement = Placement("mm", 1.0, "+Y", "+Z", (0.0, 0.0, 0.0), 120.0, 90.0, frame=order.frame)
            return Placed(placement, tuple(self._facts(head) for head in order.heads))
        if isinstance(order, ShareOrder):
            return Shared(())
        self.built.append(order)
        return self._build(order, on_image)

    def _versions(self) -> dict[str, str]:
        return dict(self.versions or content_versions(blender="none", detector="none"))

    def _facts(self, head: Head) -> HeadFacts:
        if head.name in self.bad_heads:
            return HeadFacts(error=self.bad_heads[head.name])
        return HeadFacts(vertices=3, triangles=1, anchors=self._anchors)

    def _build(self, order: BuildOrder, on_image: OnImage) -> Built:
        count, points, head = len(order.views), len(order.anchors), order.head
        images = []
        for view in order.views:
            images.append(b"" if order.images == "none" else picture(view, order.image_format))
            on_image()
        rows = UnitRows(
            subject=head.subject,
            expression=head.expression,
            split=order.split,
            head_license=head.license,
            redistributable=head.redistributable,
            angles_deg=order.views.angles_deg,
            indices=np.array(order.indices, dtype=np.int16),
            cameras=order.views.cameras,
            looks=order.views.looks,
            detected=np.ones(count, dtype=bool),
            landmarks=np.full((count, points, 3), 8.0, dtype=np.float32),
            anchors=order.anchors,
            visible=np.zeros((count, points), dtype=bool),
            images=images,
            image_suffix=f".{order.image_format}",
            factor=order.factor,
            extra={
                further_column(name): np.full((count, points, 3), 9.0, dtype=np.float32)
                for name in order.landmarks.also
            },
        )
        schema = part_schema(
            cast(ImageMode, order.images),
            self._versions(),
            order.configuration_digest,
            twins=bool(order.factor),
            also=order.landmarks.also,
        )
        check_there(Path(order.root))
        return Built(commit_unit(rows, schema, Path(order.root), order.unit), {}, self._versions())


def picture(view: View, kind: str) -> bytes:
    """An image file of one colour, which tells the pose."""
    yaw, pitch, roll = (int(angle) % 256 for angle in view.pose)
    file = io.BytesIO()
    image = Image.new("RGB", (view.camera.width, view.camera.height), (yaw, pitch, roll))
    image.save(file, {"jpg": "jpeg"}.get(kind, kind))
    return file.getvalue()


def make_heads(folder: Path, *subjects: str) -> Path:
    """Folders of one triangle each, since nothing looks at them; returns folder."""
    for subject in subjects:
        head = folder / subject / "neutral.obj"
        head.parent.mkdir(parents=True)
        head.write_text(MESH)
    return folder
