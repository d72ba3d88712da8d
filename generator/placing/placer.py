# SPDX-License-Identifier: GPL-3.0-or-later
"""Placing: the same for a build, a preview and the preview server."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from generator.errors import HeadError
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.placement import Placement
from generator.landmarks.anchors import Anchors
from generator.landmarks.detector import Detector
from generator.messages import HeadFacts, Placed
from generator.placing.anchoring import anchor_head, level_head
from generator.placing.face import find_face
from generator.placing.levelling import Levelling
from generator.placing.looking import Eyes
from generator.placing.rendering import HeadRenderer


class Placer:
    """Finds where heads stand and where their landmarks lie.

    read: a head's mesh, as its source has it; raises HeadError if it cannot be read.
    scratch: an existing folder.
    """

    def __init__(
        self,
        renderer: HeadRenderer,
        detector: Detector,
        scratch: Path,
        read: Callable[[Head], HeadMesh],
    ) -> None:
        self._renderer, self._detector, self._scratch, self._read = renderer, detector, scratch, read

    def face(self, head: Head, mesh: HeadMesh) -> Placement:
        """Axes, units, pivot and size of a head, at the pose zero of its own axes.

        Raises HeadError if no face is found.
        """
        return find_face(head, mesh, Eyes(self._renderer, self._detector, self._scratch))

    def stand(self, heads: Sequence[Head], frame: str) -> Placement:
        """Where a subject stands, by the first of its heads that shows a face; see :meth:`subject`."""
        reason = ""
        for head in heads:
            try:
                return self.subject([head], frame).placement
            except HeadError as error:
                reason = reason or str(error)
        raise HeadError(reason)

    def subject(self, heads: Sequence[Head], frame: str) -> Placed:
        """Place a subject by the first of its heads that shows a face, and anchor every one.

        frame: where pose zero is. Raises HeadError if no head shows a face.
        """
        placement: Placement | None = None
        facts: list[HeadFacts] = []
        reason = ""
        for head in heads:
            try:
                mesh = self._read(head)
                if placement is None:
                    found = self.face(head, mesh)
                    anchors, levelling = self._anchor(mesh, found)
                    placement = level_head(head, found, levelling, frame)
                else:
                    anchors, _ = self._anchor(mesh, placement)
            except HeadError as error:
                reason = reason or str(error)
                facts.append(HeadFacts(error=str(error)))
            else:
                problems = (*mesh.problems, *anchors.problems)
                facts.append(HeadFacts(len(mesh.vertices), len(mesh.triangles), problems, anchors))
        if placement is None:
            raise HeadError(reason)
        return Placed(placement, tuple(facts))

    def _anchor(self, mesh: HeadMesh, placement: Placement) -> tuple[Anchors, Levelling | None]:
        return anchor_head(mesh, placement, self._renderer, self._detector, self._scratch)
