# SPDX-License-Identifier: GPL-3.0-or-later
"""A box of a head that a render worker leaves goes to its place before the backdrop."""

from __future__ import annotations

from pathlib import Path
from typing import cast

import numpy as np
import OpenEXR
import pytest

from generator.errors import WorkerError
from generator.execution.lanes.renderer import Renderer
from generator.execution.lanes.shots import Shots
from generator.geometry.camera import Camera
from generator.messages import Rendered
from generator.picture.backdrop import noise
from generator.picture.develop import to_bytes
from generator.plan.settings import Look
from generator.plan.views import View

VIEW = View((0.0, 0.0, 0.0), Camera(24, 16, 50.0, 700.0), Look(backdrop="noise"), 5)

BOX = (3, 13, 2, 9)
"""Columns 3 to 12; rows 2 to 8 from the bottom, which are 7 to 13 from the top."""


def left_by_worker(folder: Path, width: int, height: int) -> str:
    """Red above and blue below; the left half lets everything through."""
    pixels = np.zeros((height, width, 4), np.float16)
    pixels[:1, width // 2 :] = [1, 0, 0, 1]
    pixels[1:, width // 2 :] = [0, 0, 1, 1]
    path = folder / "000000.exr"
    header = {"compression": OpenEXR.NO_COMPRESSION, "type": OpenEXR.scanlineimage}
    OpenEXR.File(header, {"RGBA": pixels}).write(str(path))
    return str(path)


def test_a_box_goes_where_it_was_rendered_and_nothing_else_changes(tmp_path: Path) -> None:
    shots = Shots(cast(Renderer, None))
    path = left_by_worker(tmp_path, 10, 7)
    image = shots.finish(Rendered(0, path, BOX), VIEW)
    assert not Path(path).exists()
    expected = to_bytes(noise(VIEW.camera, VIEW.seed))
    expected[7, 8:13], expected[8:14, 8:13] = (255, 0, 0), (0, 0, 255)
    np.testing.assert_array_equal(image, expected)


def test_a_file_of_another_size_than_its_box_is_refused(tmp_path: Path) -> None:
    path = left_by_worker(tmp_path, 10, 8)
    with pytest.raises(WorkerError, match="another size"):
        Shots(cast(Renderer, None)).finish(Rendered(0, path, BOX), VIEW)
