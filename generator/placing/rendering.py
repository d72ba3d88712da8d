# SPDX-License-Identifier: GPL-3.0-or-later
"""What placing a head needs of a render worker."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from generator.errors import WorkerError
from generator.plan.views import Views


class HeadRenderer(Protocol):
    """See :class:`generator.execution.lanes.renderer.Renderer`."""

    def render(self, package: Path, views: Views) -> Iterator[Path]:
        """Yield the image of each view of a packaged head; the caller removes it."""
        ...


def read_image(path: Path) -> np.ndarray:
    """An image that a render worker left, uint8 [H, W, 3], RGB; the file is removed.

    Raises WorkerError if there is none, or it cannot be read.
    """
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    path.unlink(missing_ok=True)
    if image is None:
        raise WorkerError(f"{path}: the render worker left no readable image")
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
