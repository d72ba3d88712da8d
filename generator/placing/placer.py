# SPDX-License-Identifier: GPL-3.0-or-later
"""Placing: the same for a build, a preview and the preview server."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from generator.errors import HeadError
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.placement import Placement
from generator.heads.surroundings import head_triangles
from generator.landmarks.anchors import Anchors
from generator.landmarks.detector import Detector
from generator.landmarks.shared import SharedAnchors, of_subject
from generator.messages import HeadFacts, Placed
from generator.placing.anchoring import anchor_head, level_head
from generator.placing.face import find_face
from generator.placing.known import anchors_on, find_known, level_known, stand_known
from generator.placing.levelling import Levelling
from generator.placing.looking import Eyes
from generator.placing.rendering import HeadRenderer
from generator.placing.sharing import FEWEST, OwnAnchors, same_topology, share


class Placer:
    """Finds where heads stand and where their landmarks lie.

    read: a head's mesh, as its source has it; raises HeadError if it cannot be read.
    scratch: an existing folder.
    shared: anchors of topologies that are known.
    """

    def __init__(
        self,
        renderer: HeadRenderer,
        detector: Detector,
        scratch: Path,
        read: Callable[[Head], HeadMesh],
        shared: Sequence[SharedAnchors] = (),
    ) -> None:
        self._renderer, self._detector, self._scratch, self._read = renderer, detector, scratch, read
        self._topology = detector.topology
        self._shared = tuple(shared)

    def face(self, head: Head, mesh: HeadMesh) -> Placement:
        """Axes, units, pivot and size of a head, at the pose zero of its own axes.

        Raises HeadError if no face is found.
        """
        known = find_known(mesh, self._shared, self._topology)
        if known is not None:
            return stand_known(head, mesh, known, self._topology)
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
        own: list[SharedAnchors] = []
        facts: list[HeadFacts] = []
        reason = ""
        for head in heads:
            try:
                mesh = self._read(head)
                if placement is None:
                    placement, anchors = self._stand(head, mesh, frame)
                    if anchors.way == "head" and anchors.views:
                        own.append(of_subject(mesh.triangles, _as_read(anchors, mesh, placement)))
                else:
                    anchors = self.anchors(mesh, placement, own)
            except HeadError as error:
                reason = reason or str(error)
                facts.append(HeadFacts(error=str(error)))
            else:
                problems = (*mesh.problems, *anchors.problems)
                facts.append(HeadFacts(len(mesh.vertices), len(mesh.triangles), problems, anchors))
        if placement is None:
            raise HeadError(reason)
        return Placed(placement, tuple(facts))

    def share(self, heads: Sequence[Head], placed: Sequence[Placed]) -> tuple[SharedAnchors, ...]:
        """The anchors of each topology that two or more of these heads have in common.

        heads: one a subject. placed: what placing each alone found. Heads that do not look along their
        axes, and those whose anchors are shared already, take no part. Raises HeadError if one cannot be
        read any more.
        """
        alone = [
            number
            for number, found in enumerate(placed)
            if (anchors := found.facts[0].anchors) is not None
            and (anchors.views and anchors.way == "head" and not any(found.placement.turned_deg))
        ]
        meshes = [self._read(heads[number]).triangles for number in alone]
        return tuple(
            share(
                self._own(heads, placed, [alone[k] for k in members]),
                self._topology,
                count=count,
                way="source",
            )
            for count, members in same_topology(meshes)
            if len(members) >= FEWEST
        )

    def _own(
        self, heads: Sequence[Head], placed: Sequence[Placed], numbers: Sequence[int]
    ) -> Iterator[OwnAnchors]:
        for number in numbers:
            found = placed[number]
            anchors = found.facts[0].anchors
            assert anchors is not None, "heads without anchors take no part"
            yield own_anchors(self._read(heads[number]), found.placement, anchors)

    def _stand(self, head: Head, mesh: HeadMesh, frame: str) -> tuple[Placement, Anchors]:
        known = find_known(mesh, self._shared, self._topology)
        if known is not None:
            found = stand_known(head, mesh, known, self._topology)
            anchors = anchors_on(mesh, found, known)
            zero: Levelling | None = level_known(anchors, known, self._topology)
        else:
            found = find_face(head, mesh, Eyes(self._renderer, self._detector, self._scratch))
            anchors, zero = anchor_head(mesh, found, self._renderer, self._detector, self._scratch)
        return level_head(head, replace(found, frame=frame), anchors, zero, self._topology), anchors

    def anchors(self, mesh: HeadMesh, placement: Placement, own: Sequence[SharedAnchors] = ()) -> Anchors:
        """The anchors of a head that stands. mesh: as read. own: of its subject's other heads."""
        known = find_known(mesh, (*self._shared, *own), self._topology)
        if known is not None:
            return anchors_on(mesh, placement, known)
        return anchor_head(mesh, placement, self._renderer, self._detector, self._scratch)[0]


def own_anchors(mesh: HeadMesh, placement: Placement, anchors: Anchors) -> OwnAnchors:
    """A head with what was found on it alone. mesh: as read."""
    return OwnAnchors(
        replace(placement, frame="source").normalise(mesh),
        _as_read(anchors, mesh, placement),
        np.reshape(placement.correction, (3, 3)),
    )


def _as_read(anchors: Anchors, mesh: HeadMesh, placement: Placement) -> Anchors:
    """A head's anchors with the triangles of its mesh as read, which may have surroundings."""
    kept = np.flatnonzero(head_triangles(mesh, placement))
    there = anchors.triangles
    return replace(anchors, triangles=np.where(there < 0, -1, kept[there]).astype(np.int32))
