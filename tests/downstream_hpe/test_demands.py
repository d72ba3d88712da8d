# SPDX-License-Identifier: MIT
"""What fit asks of a grid, said at once; and what it says of a model that learned too little."""

from __future__ import annotations

import ideal
import numpy as np
import pytest

from downstream_hpe.errors import DataError
from downstream_hpe.evaluation.scores import evaluate
from downstream_hpe.fitting import demands_of, unlearnt
from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.manifold.cosines import NARROWEST_DEG, fit_cosines
from downstream_hpe.tables.tensor import open_tensor

RANKS = (5, 3, 3, 3)
AXES = (np.linspace(-50, 50, 4), np.linspace(-40, 40, 3), np.linspace(-2, 2, 4))


def test_all_demands_are_one_line(tmp_path):
    for n, face in enumerate(ideal.Faces().draw(3, np.random.default_rng(1))):
        columns = ideal.rows(face, f"s{n}", AXES)
        ideal.drop(columns, 5)
        ideal.write(tmp_path / f"{n}.parquet", columns)
    with pytest.raises(DataError) as error:
        open_tensor(tmp_path, demands=lambda heads, axes: demands_of(RANKS, heads, axes))
    says = str(error.value)
    for demand in (
        "3 heads to learn from besides those held out, too few for identity rank 5",
        "or give --ranks 3,3,3,3",
        "3 pitch angles on the grid, expected at least 4",
        "4 degrees of roll on the grid, expected more than 4.8",
        "3 cells without landmarks",
        "choose --missing keep, exact or frontal",
    ):
        assert demand in says
    assert "yaw angles" not in says
    assert "\n" not in says


def test_the_least_that_is_asked_is_enough():
    assert demands_of(RANKS, 5, (np.linspace(-50, 50, 4),) * 3) == []
    just = np.linspace(0, 1.01 * NARROWEST_DEG, 4)
    assert demands_of(RANKS, 5, (just,) * 3) == []
    assert np.isfinite(fit_cosines(np.eye(4), just)).all()
    assert "--ranks" not in demands_of(RANKS, 1, (just,) * 3)[0]


def test_a_model_no_better_than_zero_is_said_to_be():
    ypr = np.random.default_rng(0).uniform(-40, 40, size=(50, 3))
    rotation = rotation_from_angles(ypr)
    found = [
        evaluate(name, share * ypr, rotation)
        for name, share in (
            ("constant zero", 0),
            ("rigid fit to mean face", 0),  # a measure, nothing that was learned
            ("reconstruction", 0.9),
            ("encoder + heads", 0.2),
        )
    ]
    (line,) = unlearnt(found)
    assert line.startswith("warning: encoder + heads is off by")
    assert unlearnt(found[:3]) == unlearnt([]) == []
