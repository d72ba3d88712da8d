# SPDX-License-Identifier: GPL-3.0-or-later
"""The 68 points of iBUG on the face mesh."""

from __future__ import annotations

import numpy as np

from generator.landmarks.topology import FACE_MESH


def test_the_68_points_are_symmetric_and_where_ibug_has_them():
    points = FACE_MESH.ibug_68
    assert len(set(points.indices.tolist())) == 68 and len(points.names) == 68
    face = FACE_MESH.reference_face()[points.indices]  # frame U: y up, +x the subject's left
    mirrored = [*range(16, -1, -1), *range(26, 16, -1), *range(27, 31), *range(35, 30, -1),
                45, 44, 43, 42, 47, 46, 39, 38, 37, 36, 41, 40,
                *range(54, 47, -1), *range(59, 54, -1), *range(64, 59, -1), *range(67, 64, -1)]  # fmt: skip
    np.testing.assert_allclose(face[mirrored] * [-1, 1, 1], face, atol=1e-3)
    assert face[30, 2] == face[:, 2].max()  # the nose tip
    assert face[8, 1] == face[:, 1].min()  # the chin
    for group in (face[:17], face[17:27], face[31:36], face[36:40], face[42:46], face[48:55]):
        assert (np.diff(group[:, 0]) > 0).all()  # from the subject's right to the left
    assert len(points.skeleton) == 16 + 4 + 4 + 3 + 4 + 6 + 6 + 12 + 8
