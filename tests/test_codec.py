# SPDX-License-Identifier: GPL-3.0-or-later
"""Dataclasses to plain JSON values and back."""

from __future__ import annotations

import json
from dataclasses import dataclass, field, make_dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from generator.codec import from_plain, to_plain


@dataclass(frozen=True)
class Inner:
    """Something inside."""

    size: float = 1.0
    tags: tuple[str, ...] = ()


@dataclass(frozen=True)
class Thing:
    """One of each kind of field."""

    name: str
    path: Path
    pair: tuple[int, float]
    inner: Inner
    many: tuple[Inner, ...] = ()
    maybe: Inner | None = None
    count: int = 0
    flag: bool = False
    share: float = 0.5
    by_name: dict[str, float] = field(default_factory=dict)
    kind: Literal["a", "b"] = "a"


FLOATS = st.floats(allow_nan=False)
INNER = st.builds(Inner, FLOATS, st.lists(st.text()).map(tuple))
THINGS = st.builds(
    Thing,
    name=st.text(),
    path=st.text(st.characters(exclude_characters="/\0", codec="utf-8"), min_size=1).map(Path),
    pair=st.tuples(st.integers(), FLOATS),
    inner=INNER,
    many=st.lists(INNER, max_size=3).map(tuple),
    maybe=st.none() | INNER,
    count=st.integers(),
    flag=st.booleans(),
    share=FLOATS,
    by_name=st.dictionaries(st.text(), FLOATS, max_size=3),
    kind=st.sampled_from(["a", "b"]),
)
ARRAYS = arrays.arrays(
    st.sampled_from(["<f8", ">f8", "<f4", "<i4", ">i2", "|u1", "|b1", "<i8"]),
    arrays.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4),
)


def through_json(value: Any) -> Any:
    """As it comes out of a pipe."""
    return json.loads(json.dumps(to_plain(value)))


@given(THINGS)
def test_there_and_back(thing: Thing) -> None:
    assert from_plain(Thing, through_json(thing)) == thing


@given(THINGS)
def test_a_field_at_its_default_is_left_out(thing: Thing) -> None:
    plain = to_plain(thing)
    for name, default in {"many": (), "maybe": None, "count": 0, "flag": False, "by_name": {}}.items():
        assert (name in plain) == (getattr(thing, name) != default)


@given(THINGS, st.integers())
def test_one_more_field_with_a_default_changes_no_text(thing: Thing, default: int) -> None:
    later = make_dataclass("Later", [("later", int, field(default=default))], bases=(Thing,), frozen=True)
    grown = later(**{name: getattr(thing, name) for name in Thing.__dataclass_fields__})
    assert json.dumps(to_plain(grown)) == json.dumps(to_plain(thing))
    assert from_plain(later, to_plain(thing)) == grown
    used = later(**{**vars(grown), "later": default + 1})
    assert to_plain(used) == {**to_plain(thing), "later": default + 1}


def test_a_default_of_another_type_is_no_default() -> None:
    """False is 0 and 1 is 1.0 in Python, but not in JSON."""
    assert to_plain(Inner(1)) == {"size": 1}
    assert to_plain(Inner(1.0)) == {}


@given(ARRAYS)
def test_arrays_keep_shape_bits_and_kind(array: np.ndarray) -> None:
    plain = through_json(array)
    again = from_plain(np.ndarray, plain)
    assert again.shape == array.shape
    assert again.dtype == array.dtype.newbyteorder("<")
    assert again.tobytes() == array.astype(again.dtype).tobytes()
    assert again.flags.writeable and again.flags.owndata
    assert to_plain(again) == plain


@given(ARRAYS.filter(lambda array: array.ndim > 1))
def test_arrays_that_lie_otherwise_in_memory_are_the_same(array: np.ndarray) -> None:
    assert to_plain(np.asfortranarray(array)) == to_plain(array)
    assert to_plain(array[::-1]) == to_plain(array[::-1].copy())


def test_nan_and_infinity_pass() -> None:
    """Python's JSON has them, and they stand in placements."""
    again = from_plain(tuple[float, ...], through_json((float("nan"), float("inf"))))
    assert again[0] != again[0] and again[1] == float("inf")


@pytest.mark.parametrize("value", [object(), {1, 2}, b"bytes", np.int64(3), Thing, 1j])
def test_what_has_no_plain_form_is_refused(value: object) -> None:
    with pytest.raises(TypeError, match="no plain form"):
        to_plain(value)


THING = {"name": "n", "path": "/p", "pair": [1, 2.0], "inner": {}}


@pytest.mark.parametrize(
    "change",
    [
        {"colour": "red"},
        {"inner": {"colour": "red"}},
        {"many": [{"colour": "red"}]},
        {"pair": [1]},
        {"pair": [1, 2.0, 3]},
        {"inner": []},
        {"inner": 3},
        {"inner": "text"},
        {"many": 3},
        {"by_name": ["a"]},
        {"share": "much"},
        {"path": 3},
    ],
    ids=str,
)
def test_what_is_no_such_thing_is_refused(change: dict) -> None:
    assert from_plain(Thing, THING)
    with pytest.raises((TypeError, ValueError)):
        from_plain(Thing, {**THING, **change})


@pytest.mark.parametrize("missing", THING)
def test_what_is_missing_is_refused(missing: str) -> None:
    with pytest.raises(TypeError, match=missing):
        from_plain(Thing, {key: value for key, value in THING.items() if key != missing})


ARRAY = {"dtype": "<f8", "shape": [2], "data": "AAAAAAAAAAAAAAAAAAAAAA=="}


@pytest.mark.parametrize(
    "change",
    [{"dtype": "nonsense"}, {"shape": [3]}, {"data": "AAA"}, {"data": "AAAA"}, {"data": 3}, {"dtype": "O"}],
    ids=str,
)
def test_a_damaged_array_is_refused(change: dict) -> None:
    assert from_plain(np.ndarray, ARRAY).shape == (2,)
    with pytest.raises((TypeError, ValueError)):
        from_plain(np.ndarray, {**ARRAY, **change})


@pytest.mark.parametrize("value", [{}, {"dtype": "<f8"}, [], 3, "text", None], ids=str)
def test_what_is_no_array_is_refused(value: object) -> None:
    with pytest.raises((TypeError, ValueError)):
        from_plain(np.ndarray, value)
