# SPDX-License-Identifier: GPL-3.0-or-later
"""What rows say of their look, and heads of where their anchors come from, is held against something else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from damage import PART, failures, rewrite

from generator.dataset.format.anchors_table import HeadAnchors, read_anchors
from generator.dataset.format.heads_table import IDENTITY, read_heads
from generator.dataset.format.part import read_part
from generator.dataset.proof.exact_checks import levelling_problems
from generator.dataset.proof.verify import verify_dataset
from generator.geometry.rotation import graphics_rotation, rotation_from_angles
from generator.landmarks.facing import facing
from generator.landmarks.shared import packaged
from generator.landmarks.topology import FACE_MESH

NAN = float("nan")


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("look_ambient", 0.9),
        ("look_ambient", NAN),
        ("look_backdrop", ""),
        ("look_background", [0.5, 0.5, 0.6]),
        ("look_background", [0.5, NAN, 0.5]),
    ],
)
def test_a_look_that_was_not_planned_is_found(dataset: Path, column: str, value: object) -> None:
    """Also where a single row says nothing, as all of an older part may."""
    said = read_part(dataset / PART)[column].to_pylist()
    rewrite(dataset, {column: [value, *said[1:]]}, honest=True)
    assert f"{column} is not what the configuration plans" in failures(verify_dataset(dataset))["look"]


def test_a_part_that_is_older_than_looks_says_nothing_of_them(dataset: Path) -> None:
    count = len(read_part(dataset / PART))
    rewrite(dataset, {"look_ambient": [NAN] * count, "look_backdrop": [""] * count}, honest=True)
    assert "look" not in failures(verify_dataset(dataset))


def test_anchors_that_are_not_the_package_s_do_not_pass_for_them(dataset: Path) -> None:
    [ours] = packaged(FACE_MESH)
    head = replace(
        read_heads(dataset)[0],
        anchor_way="package",
        correction=ours.correction,
        correction_sd_deg=ours.correction_sd_deg,
    )
    name = head.subject, head.expression

    def problems(weights: object) -> list[str]:
        anchors = HeadAnchors(*name, ours.anchors.triangles, weights, ours.anchors.points)
        return list(levelling_problems([head], {name: anchors}, FACE_MESH))

    assert problems(ours.anchors.weights) == []
    [said] = problems(ours.anchors.weights[:, [1, 0, 2]])
    assert said == f"anchors.parquet: {'/'.join(name)}: not the anchors of the package"


def test_a_correction_is_held_against_the_anchors_before_it(dataset: Path) -> None:
    """Those of a levelled head were turned by it; where the mesh's own pose stays, they were not."""
    aside = rotation_from_angles(np.array([40.0, 0, 0]))
    own = packaged(FACE_MESH)[0].anchors.points @ aside.T
    fit = facing(own, FACE_MESH)
    assert fit is not None
    correction = graphics_rotation(fit.T)
    first = replace(
        read_heads(dataset)[0],
        correction=tuple(correction.ravel().tolist()),
        correction_sd_deg=(1.0, 1.0, 1.0),
    )
    for frame, points, right in (
        ("source", own, True),
        ("source", own @ graphics_rotation(correction).T, False),
        ("level", own @ graphics_rotation(correction).T, True),
        ("level", own, False),
    ):
        anchors = HeadAnchors("s1", "neutral", np.arange(468), np.ones((468, 3)), points)
        found = list(
            levelling_problems([replace(first, frame=frame)], {("s1", "neutral"): anchors}, FACE_MESH)
        )
        assert ["degrees from what its anchors say" in problem for problem in found] == [True] * (not right)


def test_a_subject_has_one_correction_and_it_is_that_of_its_anchors(dataset: Path) -> None:
    anchors = read_anchors(dataset)
    first = replace(read_heads(dataset)[0], correction=IDENTITY)
    turned = (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    for other, said in (
        (replace(first, expression="smile", correction=turned), "s1 has more than one correction"),
        (replace(first, expression="smile", frame="levelled"), "s1 has more than one correction"),
        (replace(first, subject="s2", correction=turned), ""),
    ):
        found = list(levelling_problems([first, other], anchors, FACE_MESH))
        assert [problem for problem in found if "one correction" in problem] == (
            [f"heads.parquet: {said}"] if said else []
        )
