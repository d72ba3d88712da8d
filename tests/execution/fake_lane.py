# SPDX-License-Identifier: GPL-3.0-or-later
"""A lane that does what the name of a unit says, and keeps a journal in the order's root.

As a program it is a lane process: the real generator.execution.lanes.lane_main, with this lane in it.

    plain      builds nothing, and says it did          head       HeadError
    breaks     WorkerError                              once       WorkerError, but the second time plain
    dies       its process ends                         dies_once  its process ends, but the second time plain
    disk       DatasetError                             waits      works until the lane is ended
    slow       plain, after 50 ms                       missing    a kind of HeadError
"""

from __future__ import annotations

import json
import os
import sys
import time
import types
import uuid
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from generator.dataset.format.part_info import PartInfo
from generator.errors import DatasetError, HeadError, WorkerError
from generator.execution.lanes.options import LaneOptions, OnImage
from generator.geometry.camera import Camera
from generator.heads.head import Head
from generator.heads.paths import MissingFile
from generator.heads.placement import Placement
from generator.messages import (
    BuildOrder,
    Built,
    HeadFacts,
    LaneOrder,
    Placed,
    PlaceOrder,
    Receipt,
    Versions,
    VersionsOrder,
)
from generator.plan.settings import Look
from generator.plan.views import Views

JOURNAL = "journal.jsonl"
PLACEMENT = Placement("mm", 1.0, "+Y", "+Z", (0.0, 0.0, 0.0), 120.0, 90.0)


@dataclass(frozen=True)
class Entry:
    """A line of the journal. what: "run", "close" or "kill"."""

    what: str
    lane: str
    pid: int
    unit: str = ""
    head: str = ""


class FakeLane:
    """See :class:`generator.execution.lanes.options.AnyLane`."""

    def __init__(self, options: LaneOptions) -> None:
        self.options, self.name = options, uuid.uuid4().hex
        self._root: Path | None = None

    def run(self, order: LaneOrder, on_image: OnImage) -> Receipt:
        """Carry out one order."""
        if isinstance(order, VersionsOrder):
            return Versions({"fake": "1"})
        if isinstance(order, PlaceOrder):
            return Placed(PLACEMENT, tuple(HeadFacts(error="not looked at") for _ in order.heads))
        self._root = Path(order.root)
        self._write("run", order)
        self._act(order.unit.partition("-")[0], self._root / f"{order.unit}.seen")
        for _ in order.views:
            on_image()
        return Built(PartInfo(order.part_path, len(order.views), 0, 1, "0", "0", "", ""), {"fake": 0.5}, {})

    def close(self) -> None:
        """Ended in order."""
        self._write("close")

    def kill(self) -> None:
        """Ended at once."""
        self._write("kill")

    def _act(self, what: str, seen: Path) -> None:
        again = seen.exists()
        seen.touch()
        match what:
            case "head":
                raise HeadError("a.obj: not a head")
            case "missing":
                raise MissingFile("the texture 'a.png' is missing")
            case "breaks":
                raise WorkerError("Blender was killed", "the last line of its log")
            case "once" if not again:
                raise WorkerError("Blender was killed", "the last line of its log")
            case "dies":
                os._exit(7)
            case "dies_once" if not again:
                os._exit(7)
            case "disk":
                raise DatasetError("no space left on device")
            case "slow":
                time.sleep(0.05)
            case "waits":
                time.sleep(600)

    def _write(self, what: str, order: BuildOrder | None = None) -> None:
        if self._root is None:
            return  # it was given nothing to do
        entry: dict[str, Any] = {"what": what, "lane": self.name, "pid": os.getpid()}
        if order is not None:
            entry |= {"unit": order.unit, "head": order.head.name}
        with (self._root / JOURNAL).open("a", encoding="utf-8") as file:
            file.write(json.dumps(entry) + "\n")


def read_journal(root: Path) -> list[Entry]:
    """What lanes did, in its order."""
    file = root / JOURNAL
    return [Entry(**json.loads(line)) for line in file.read_text().splitlines()] if file.exists() else []


def unit_order(root: Path, unit: str, subject: str = "amy", images: int = 2) -> BuildOrder:
    """A build order whose unit says what happens."""
    mesh = Path("/nowhere/a.obj")
    return BuildOrder(
        unit=unit,
        head=Head(subject, "neutral", "mesh", mesh, (mesh,)),
        root=str(root),
        views=Views(((0.0, 0.0, 0.0),) * images, (Camera.square(16, 85.0, 700.0),), (Look(),)),
        indices=((0, 0, 0),) * images,
        placement=PLACEMENT,
        anchors=np.zeros((0, 3)),
        split="train",
        images="none",
        image_format="png",
    )


def main() -> None:
    """Serve as a lane process, without what a real lane imports."""
    stand_in = types.ModuleType("generator.execution.lanes.lane")
    stand_in.Lane = FakeLane  # type: ignore[attr-defined]
    sys.modules[stand_in.__name__] = stand_in
    from generator.execution.lanes import lane_main

    lane_main.main()


if __name__ == "__main__":
    main()
