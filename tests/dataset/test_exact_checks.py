# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact landmarks are held against anchors, rotation and camera, whichever heads a batch has."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from small_dataset import face_anchors, replaced

from generator.dataset.format.open import as_array
from generator.dataset.format.schema import part_schema
from generator.dataset.format.unit_rows import UnitRows, unit_table
from generator.dataset.proof.context import RowContext
from generator.dataset.proof.exact_checks import exact_problems

SECOND = 9
"""From this row on they are of the other head."""


@dataclass
class Rows:
    """Of two heads with anchors of their own, float64 [2, 468, 3]; landmarks follow from them."""

    batch: pa.RecordBatch
    anchors: np.ndarray
    rotation: np.ndarray

    def problems(self, exact: np.ndarray | None = None, visible: np.ndarray | None = None) -> list[str]:
        """What is found, with the place of its row in front."""
        heads = np.repeat([0, 1], [SECOND, len(self.batch) - SECOND])
        right = self.right(heads) if exact is None else exact
        context = RowContext(Path(), "none", self.anchors, lambda head, pose: None, head_index=heads)  # type: ignore[arg-type,return-value]
        batch = replaced(self.batch, "landmarks_exact", listed(right))
        batch = replaced(batch, "rotation", listed(self.rotation))
        anchored = np.isfinite(self.anchors).all(axis=2)[heads]
        # Nothing is seen of the sides: there are no images here that they could lie outside of.
        batch = replaced(
            batch, "landmarks_visible", listed(np.zeros_like(anchored) if visible is None else visible)
        )
        self.measured = context.measured
        found = exact_problems(batch, context)
        names = batch.column("sample_id").to_pylist()
        return sorted(
            f"{names.index(name)}: {what}" for name, _, what in (one.partition(": ") for one in found)
        )

    def right(self, heads: np.ndarray) -> np.ndarray:
        """R_C X + t as float32."""
        turned = self.anchors[heads] @ np.swapaxes(self.rotation, 1, 2)
        return (turned + as_array(self.batch, "translation_mm")[:, None]).astype(np.float32)


def listed(values: np.ndarray) -> pa.FixedSizeListArray:
    """A list of each row's numbers."""
    flat = np.ascontiguousarray(values).reshape(len(values), -1)
    return pa.FixedSizeListArray.from_arrays(pa.array(flat.ravel()), flat.shape[1])


@pytest.fixture
def two(rows: UnitRows) -> Rows:
    [batch] = unit_table(rows, part_schema("none", {}, "")).to_batches()
    anchors = np.stack([face_anchors(), face_anchors() * [1.1, 0.9, 1.0]])
    return Rows(batch, anchors, as_array(batch, "rotation").reshape(-1, 3, 3).copy())


NO_FIT = "the rigid fit of landmarks_exact does not give rotation back"
OFF = "landmarks_exact is not R_C X + t of its anchors"


def test_what_follows_from_anchors_is_right(two: Rows) -> None:
    assert two.problems() == []
    assert 0 < two.measured["closure_deg"] < 1e-5


@pytest.mark.parametrize(
    ("kept", "asked"), [([], False), ([50, 200], False), ([50, 200, 400], True), ([*range(467)], True)]
)
def test_a_rotation_that_is_none_is_found_by_the_fit(two: Rows, kept: list[int], asked: bool) -> None:
    """Of heads with three anchors or more, and those without do not keep others from being looked at."""
    two.anchors[0, np.setdiff1d(np.arange(468), kept)] = np.nan
    shear = np.eye(3) + np.array([[0, 1e-3, 0], [0, 0, 0], [0, 0, 0]])
    two.rotation[[4, 12]] = two.rotation[[4, 12]] @ shear
    assert two.problems() == [f"12: {NO_FIT}", *([f"4: {NO_FIT}"] if asked else [])]


@pytest.mark.parametrize(("steps", "right"), [(0, True), (1, True), (2, False), (-1, False)])
def test_landmarks_are_right_to_the_last_bit(two: Rows, steps: int, right: bool) -> None:
    """Rounded to either of the two floats beside them, and to no other."""
    exact = two.right(np.repeat([0, 1], [SECOND, SECOND]))
    true = (two.anchors[1, 7] @ two.rotation[11].T + as_array(two.batch, "translation_mm")[11])[2]
    exact[11, 7, 2] += steps * np.spacing(exact[11, 7, 2]) * np.sign(true - exact[11, 7, 2])
    assert two.problems(exact) == ([] if right else [f"11: {OFF}"])


def test_a_point_without_an_anchor_is_not_a_number(two: Rows) -> None:
    exact = two.right(np.repeat([0, 1], [SECOND, SECOND]))
    exact[3, 467] = 0.0
    assert two.problems(exact) == [f"3: {OFF}"]


def test_of_what_is_seen_there_is_an_anchor_inside_the_image(two: Rows) -> None:
    visible = np.zeros((2 * SECOND, 468), bool)
    visible[:, 200] = True
    assert two.problems(visible=visible) == []
    visible[6, 467] = True
    assert two.problems(visible=visible) == ["6: a landmark without an anchor is visible"]
    two.anchors[1, 200] = [900.0, 0, 0]
    found = two.problems(visible=visible)
    assert [one for one in found if "without" not in one] == sorted(
        f"{row}: a landmark outside the image is visible" for row in range(SECOND, 2 * SECOND)
    )
