# SPDX-License-Identifier: GPL-3.0-or-later
"""What placing a head needs of a render worker."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Protocol

from generator.plan.render_settings import RenderSettings


class HeadRenderer(Protocol):
    """See :class:`generator.execution.lanes.renderer.Renderer`."""

    def render(
        self, package: Path, settings: RenderSettings, distance_mm: float, poses: Sequence[Sequence[float]]
    ) -> Iterator[Path]:
        """Yield the frame of each pose (yaw, pitch, roll), degrees; the caller removes it."""
        ...
