# SPDX-License-Identifier: GPL-3.0-or-later
"""What placing heads found, kept in the dataset's folder: a resumed build does not look again."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from generator import registries
from generator.codec import to_plain
from generator.content import deciding
from generator.dataset.format.build_files import PLACED_FILE
from generator.dataset.format.files import append_line
from generator.errors import DatasetError, HeadturnError, WorkerError
from generator.execution.executors.executor import Executor
from generator.execution.lanes.slot import Outcome
from generator.heads.units import axes_rotation, is_scale
from generator.landmarks.shared import SharedAnchors, shared_levelling_problem
from generator.messages import (
    Placed,
    PlaceOrder,
    Shared,
    Versions,
    VersionsOrder,
    expect,
    from_json,
    to_json,
)
from generator.plan.settings import Landmarks
from generator.sealed import read_sealed_lines, sealed_line


def lane_versions(executor: Executor, landmarks: Landmarks) -> dict[str, str]:
    """Name and version of everything in a lane that decides content.

    Raises WorkerError if no lane can be started.
    """
    [outcome] = executor.run([VersionsOrder(landmarks)], lambda: None)
    if outcome.receipt is None:
        raise WorkerError(f"no render worker can be started: {outcome.error}", outcome.log)
    return expect(Versions, outcome.receipt).versions


class PlacedHeads:
    """Receipts of place orders, one sealed JSON line each, known by what they depend on.

    A line that contradicts itself or its order is as good as none: that subject is looked at again.

    versions: of :func:`lane_versions`. file_sha256: of every file of every head, by its path.
    """

    def __init__(self, root: Path, versions: Mapping[str, str], file_sha256: Mapping[str, str]) -> None:
        self._path = root / PLACED_FILE
        self._versions, self._file_sha256 = deciding(versions), file_sha256
        self._known, self._shared = _read(self._path)

    def shared(self, landmarks: Landmarks) -> tuple[SharedAnchors, ...]:
        """Anchors that were shared before in this dataset, of these settings and versions."""
        topology = registries.DETECTORS.get(landmarks.detector).topology
        found = (
            one for receipt in self._shared.get(self._shared_key(landmarks), ()) for one in receipt.anchors
        )
        return tuple(one for one in found if not one.contradiction(topology))

    def keep_shared(self, receipt: Shared, landmarks: Landmarks) -> None:
        """Raises DatasetError if it cannot be written."""
        line = {"key": self._shared_key(landmarks), "receipt": to_json(receipt)}
        append_line(self._path, sealed_line(line))

    def outcomes(self, orders: Sequence[PlaceOrder], executor: Executor) -> Iterator[Outcome]:
        """The outcome of each order: known from before, or carried out now and kept.

        Raises DatasetError if it cannot be written.
        """
        unknown = []
        for order in orders:
            receipt = self._known.get(self._key(order))
            if receipt is None or _problem(receipt, order):
                unknown.append(order)
            else:
                yield Outcome(order, receipt)
        for outcome in executor.run(unknown, lambda: None):
            if outcome.receipt is not None:
                key = self._key(expect(PlaceOrder, outcome.order))
                self._known[key] = expect(Placed, outcome.receipt)
                line = {"key": key, "receipt": to_json(outcome.receipt)}
                append_line(self._path, sealed_line(line))
            yield outcome

    def _shared_key(self, landmarks: Landmarks) -> str:
        text = json.dumps(["shared", to_plain(landmarks), self._versions], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()

    def _key(self, order: PlaceOrder) -> str:
        """The order says which detector and how sure it must be; the rest is files and versions."""
        hashes = [[self._file_sha256[str(file)] for file in head.files] for head in order.heads]
        text = json.dumps([to_json(order), hashes, self._versions], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def _read(path: Path) -> tuple[dict[str, Placed], dict[str, list[Shared]]]:
    placed: dict[str, Placed] = {}
    shared: dict[str, list[Shared]] = {}
    try:
        for record in read_sealed_lines(path):
            with contextlib.suppress(ValueError, KeyError, TypeError):  # of another version: looked at again
                receipt = from_json(record["receipt"])
                if isinstance(receipt, Shared):
                    shared.setdefault(record["key"], []).append(receipt)
                else:
                    placed[record["key"]] = expect(Placed, receipt)
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path}: cannot be read ({error}); delete it and run the build again") from error
    return placed, shared


def _problem(placed: Placed, order: PlaceOrder) -> str:
    """Why what was found before cannot be so, or "": a file in the dataset's folder is not believed."""
    placement = placed.placement
    if len(placed.facts) != len(order.heads) or placement.frame != order.frame:
        return "it is about other heads"
    if not is_scale(placement.units, placement.mm_per_unit):
        return f"{placement.mm_per_unit!r} mm are not in one {placement.units}"
    try:
        axes_rotation(placement.up, placement.forward)
    except (HeadturnError, ValueError) as error:
        return str(error)
    topology = registries.DETECTORS.get(order.landmarks.detector).topology
    anchors = [fact.anchors for fact in placed.facts if fact.anchors is not None]
    if wrong := next((problem for found in anchors if (problem := found.contradiction(topology))), ""):
        return wrong
    return shared_levelling_problem(
        placement.frame,
        placement.correction,
        placement.correction_sd_deg,
        [found.points for found in anchors],
        topology,
        anchors[0].way if anchors else "head",
    )
