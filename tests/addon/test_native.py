# SPDX-License-Identifier: GPL-3.0-or-later
"""The add-on among Blender's own things: keys, rings, presets, menus, files that are dropped, languages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from real_blender import RealBlender
from sitting import sit

from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import save_package

pytestmark = [pytest.mark.slow, pytest.mark.timeout(600)]


@pytest.fixture(scope="module")
def block(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A head that is loaded at once: a block with a nose, 200 mm high."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float) * (60, 90, 60)
    nose = np.array([[-12, 0, 60], [12, 0, 60], [0, 30, 60], [0, 0, 100]], float)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = [half for a, b, c, d in sides for half in ((a, b, c), (a, c, d))]
    faces += [(8, 9, 11), (9, 10, 11), (10, 8, 11)]
    path = tmp_path_factory.mktemp("block") / "head.npz"
    mesh = HeadMesh(
        np.concatenate([corners, nose]), np.array(faces, np.int32), None, None,
        np.zeros(len(faces), np.int32), (Material("skin", (0.8, 0.6, 0.5), None),),
    )  # fmt: skip
    save_package(mesh, path)
    return path


def test_the_addon_among_blenders_own_things(real_blender: RealBlender, block: Path) -> None:
    sit(real_blender, "native", HEADTURN_TEST_HEAD=str(block))
