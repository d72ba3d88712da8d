# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray's actor with a fake lane in it; imported by Ray's own processes."""

from __future__ import annotations

from fake_lane import FakeLane

from generator.execution.executors import ray


class FakeLaneActor(ray.LaneActor):
    """See :class:`generator.execution.executors.ray.LaneActor`."""

    def __init__(self, options: str) -> None:
        ray.Lane = FakeLane  # type: ignore[misc, assignment]
        super().__init__(options)
