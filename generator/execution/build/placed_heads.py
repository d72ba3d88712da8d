# SPDX-License-Identifier: GPL-3.0-or-later
"""What placing heads found, kept in the dataset's folder: a resumed build does not look again."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from generator.content import deciding
from generator.dataset.format.files import append_line
from generator.errors import WorkerError
from generator.execution.executors.executor import Executor
from generator.execution.lanes.slot import Outcome
from generator.messages import Placed, PlaceOrder, Versions, VersionsOrder, expect, from_json, to_json
from generator.plan.settings import Landmarks

PLACED_FILE = "placed.jsonl"
FIRST_PLACED_FILE = "prepared.jsonl"
"""As the first release called it."""


def lane_versions(executor: Executor, landmarks: Landmarks) -> dict[str, str]:
    """Name and version of everything in a lane that decides content.

    Raises WorkerError if no lane can be started.
    """
    [outcome] = executor.run([VersionsOrder(landmarks)], lambda: None)
    if outcome.receipt is None:
        raise WorkerError(f"no render worker can be started: {outcome.error}", outcome.log)
    return expect(Versions, outcome.receipt).versions


class PlacedHeads:
    """Receipts of place orders, one JSON line each, known by what they depend on.

    versions: of :func:`lane_versions`. file_sha256: of every file of every head, by its path.
    """

    def __init__(self, root: Path, versions: Mapping[str, str], file_sha256: Mapping[str, str]) -> None:
        self._path = root / PLACED_FILE
        self._versions, self._file_sha256 = deciding(versions), file_sha256
        self._known = _read(self._path)

    def outcomes(self, orders: Sequence[PlaceOrder], executor: Executor) -> Iterator[Outcome]:
        """The outcome of each order: known from before, or carried out now and kept.

        Raises DatasetError if it cannot be written.
        """
        unknown = []
        for order in orders:
            receipt = self._known.get(self._key(order))
            if receipt is None:
                unknown.append(order)
            else:
                yield Outcome(order, receipt)
        for outcome in executor.run(unknown, lambda: None):
            if outcome.receipt is not None:
                line = {
                    "key": self._key(expect(PlaceOrder, outcome.order)),
                    "receipt": to_json(outcome.receipt),
                }
                append_line(self._path, json.dumps(line))
            yield outcome

    def _key(self, order: PlaceOrder) -> str:
        """The order says which detector and how sure it must be; the rest is files and versions."""
        hashes = [[self._file_sha256[str(file)] for file in head.files] for head in order.heads]
        text = json.dumps([to_json(order), hashes, self._versions], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()


def _read(path: Path) -> dict[str, Placed]:
    known: dict[str, Placed] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8", errors="replace").splitlines():
            try:
                record: dict[str, Any] = json.loads(line)
                known[record["key"]] = expect(Placed, from_json(record["receipt"]))
            except (ValueError, KeyError, TypeError, AttributeError):
                continue  # cut short by a crash: that head is looked at again
    return known
