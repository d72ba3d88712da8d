# SPDX-License-Identifier: GPL-3.0-or-later
"""What the shipped model is made of: the builds of scripts/make_model.py."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import make_model

LEARNED = (make_model.GRID, *make_model.TRAINING)
MEASURED = (
    *make_model.TESTS.values(),
    make_model.ICT_TEST,
    make_model.BEYOND,
    make_model.PROFILE,
    make_model.OTHERS,
)


def option(command, name):
    return command[command.index(name) + 1]


def test_no_head_is_both_learned_from_and_measured_on():
    assert not {one.seed for one in LEARNED} & {one.seed for one in MEASURED}
    names = [one.name for one in (*dict.fromkeys(LEARNED), *MEASURED)]
    assert len(set(names)) == len(names)


def test_heads_are_those_of_the_source_that_is_given():
    for one in LEARNED:
        command = one.command(Path("w"), 1.0, "parametric")
        assert option(command, "--heads") == "parametric" and option(command, "--count") == str(one.heads)
    scans = make_model.OTHERS.command(Path("w"), 1.0, "scans")
    assert option(scans, "--heads") == "scans" and "--count" not in scans


def test_a_small_scale_keeps_what_a_fit_needs():
    counts = {one.name: int(option(one.command(Path("w"), 0.01, "x"), "--count")) for one in LEARNED}
    assert counts.pop("grid") == make_model.GRID.fewest and set(counts.values()) == {2}


def test_pose_zero_is_the_same_in_all():
    frames = {option(one.command(Path("w"), 1.0, "x"), "--frame") for one in (*LEARNED, *MEASURED)}
    assert frames == {"level"}


def test_a_card_without_photographs_says_so():
    assert make_model.photographs(Path("model"), None) == make_model.NOT_MEASURED
