# SPDX-License-Identifier: GPL-3.0-or-later
"""A texture in the image: where it goes on, and what it is multiplied with."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from generator.execution.lanes.renderer import Renderer
from generator.geometry.camera import Camera
from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import save_package
from generator.heads.tiling import EXTEND, MIRROR, REPEAT
from generator.plan.settings import Look
from generator.plan.views import Views

DISTANCE = 700.0
CAMERA = Camera.square(96, 85.0, DISTANCE)
RED, GREEN = (0, 0, 255), (0, 255, 0)


def square(material: Material, size: float = 1.0, colors: np.ndarray | None = None) -> HeadMesh:
    """80 mm wide, in the middle, coordinates from 0 to size."""
    corners = np.array([[-40, -40, 0], [40, -40, 0], [40, 40, 0], [-40, 40, 0]], float)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32) * np.float32(size)
    order = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return HeadMesh(corners, order, uv[order], colors, np.zeros(2, np.int32), (material,))


def colors_along(renderer: Renderer, mesh: HeadMesh, folder: Path, x: list[float]) -> list[list[int]]:
    """RGB at some x (mm) of the square's middle line."""
    save_package(mesh, folder / "head.npz")
    look = Look(ambient=1.0, samples=4)
    [path] = renderer.render(folder / "head.npz", Views(((0, 0, 0),), (CAMERA,), (look,)))
    image = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)
    pixels = [CAMERA.project(np.array([at, 0.0, DISTANCE])) for at in x]
    return [image[int(row), int(column)].tolist() for column, row in pixels]


@pytest.mark.parametrize(("wrap", "expected"), [(EXTEND, "rggg"), (REPEAT, "rgrg"), (MIRROR, "rggr")])
def test_a_texture_goes_on(renderer: Renderer, tmp_path: Path, wrap: str, expected: str) -> None:
    """Left half red, right half green, twice from left to right."""
    cv2.imwrite(str(tmp_path / "t.png"), np.array([[RED] * 8 + [GREEN] * 8] * 16, np.uint8))
    mesh = square(Material("t", (1, 1, 1), tmp_path / "t.png", wrap=wrap), size=2)
    seen = colors_along(renderer, mesh, tmp_path, [-30, -10, 10, 30])
    assert seen == [{"r": [255, 0, 0], "g": [0, 255, 0]}[letter] for letter in expected]


def test_a_texture_is_multiplied_in_linear_light(renderer: Renderer, tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "white.png"), np.full((4, 4, 3), 255, np.uint8))
    tint = (0.1, 0.06, 0.04)
    mesh = square(Material("t", (1, 1, 1), tmp_path / "white.png", tint=tint))
    np.testing.assert_allclose(colors_along(renderer, mesh, tmp_path, [0]), [[89, 69, 57]], atol=2)
    colors = np.full((4, 3), (1.0, 0.5, 0.0), np.float32)
    mesh = square(Material("t", (1, 1, 1), tmp_path / "white.png", vertex_tint=True), colors=colors)
    np.testing.assert_allclose(colors_along(renderer, mesh, tmp_path, [0]), [[255, 128, 0]], atol=1)
    mesh = square(Material("t", (1, 1, 1), tmp_path / "white.png"), colors=colors)
    assert colors_along(renderer, mesh, tmp_path, [0]) == [[255, 255, 255]]
