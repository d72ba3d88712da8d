# SPDX-License-Identifier: GPL-3.0-or-later
"""Every message comes out of a pipe as it went in, and nothing else comes out of it."""

from __future__ import annotations

import json
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from generator import messages
from generator.geometry.camera import Camera
from generator.heads.head import Head
from generator.heads.placement import Placement
from generator.messages import (
    BuildOrder,
    LaneFailed,
    OrderDone,
    PlaceOrder,
    Progressed,
    Rendered,
    Versions,
    VersionsOrder,
    expect,
    from_json,
    to_json,
)
from generator.plan.settings import Landmarks, Look
from generator.plan.views import Views

KINDS = {
    name: kind
    for name, kind in vars(messages).items()
    if isinstance(kind, type) and kind.__module__ == messages.__name__ and name != "HeadFacts"
}
"""HeadFacts is said within a message alone."""

ANGLE = st.floats(-180, 180)
CAMERA = st.builds(
    Camera,
    *(st.integers(1, 4096), st.integers(1, 4096), st.floats(1, 1000), st.floats(1, 1e6)),
    projection=st.sampled_from(["perspective", "orthographic"]),
    principal_px=st.none() | st.tuples(st.floats(0, 100), st.floats(0, 100)),
)


@st.composite
def some_views(draw: st.DrawFn) -> Views:
    """Cameras and looks that are shared, or one a view."""
    count = draw(st.integers(1, 4))
    of = {1: st.integers(1, 1)}.get(count, st.sampled_from([1, count]))
    cameras, looks = draw(of), draw(of)
    return Views(
        tuple(draw(st.tuples(ANGLE, ANGLE, ANGLE)) for _ in range(count)),
        tuple(draw(CAMERA) for _ in range(cameras)),
        tuple(draw(st.builds(Look)) for _ in range(looks)),
    )


st.register_type_strategy(Views, some_views())
st.register_type_strategy(Camera, CAMERA)
st.register_type_strategy(Path, st.text("abcZ./ \\é", min_size=1).map(Path))
st.register_type_strategy(
    np.ndarray,
    arrays.arrays(
        st.sampled_from(["<f8", "<i4"]), arrays.array_shapes(min_dims=1, max_dims=2, min_side=0, max_side=3)
    ),
)


def same(a: Any, b: Any) -> bool:
    """The same type, and bit by bit the same values; NaN is NaN."""
    if type(a) is not type(b):
        return False
    if is_dataclass(a):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, np.ndarray):
        return (a.dtype, a.shape, a.tobytes()) == (b.dtype, b.shape, b.tobytes())
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[key], b[key]) for key in a)
    return bool(a == b or (a != a and b != b))


def test_every_order_and_receipt_is_a_message() -> None:
    assert set(get_args(messages.LaneOrder)) | set(get_args(messages.Receipt)) <= set(KINDS.values())
    assert len(KINDS) >= 15


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
@given(data=st.data())
def test_a_message_comes_out_as_it_went_in(kind: type, data: st.DataObject) -> None:
    message = data.draw(st.from_type(kind))
    line = json.dumps(to_json(message))
    assert "\n" not in line
    again = from_json(json.loads(line))
    assert same(again, message), (again, message)
    assert json.dumps(to_json(again)) == line, "and says the same"


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
@settings(max_examples=3)
@given(data=st.data())
def test_what_a_message_does_not_have_is_refused(kind: type, data: st.DataObject) -> None:
    values = to_json(data.draw(st.from_type(kind)))
    with pytest.raises(TypeError, match="has no later"):
        from_json({**values, "later": 1})


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
def test_what_it_must_have_is_missed(kind: type) -> None:
    try:
        whole = to_json(kind())
    except TypeError:
        with pytest.raises(TypeError, match="missing"):
            from_json({"is": kind.__name__})
    else:
        assert whole == {"is": kind.__name__}, "all of it has a default, and is left out"


@pytest.mark.parametrize(
    "values",
    [{}, {"is": ""}, {"is": "Nonsense"}, {"is": "HeadFacts"}, {"is": "Head"}, {"is": None}, {"is": 3},
     {"is": ["Progressed"]}, {"is": {}}, [], ["is"], "Progressed", 3, None, True],
    ids=repr,
)  # fmt: skip
def test_what_is_no_message_is_refused(values: Any) -> None:
    with pytest.raises((ValueError, TypeError)):
        from_json(values)


JSON = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


@pytest.mark.parametrize("kind", KINDS.values(), ids=KINDS)
@given(data=st.data())
def test_a_damaged_message_is_refused_or_one(kind: type, data: st.DataObject) -> None:
    """Whatever stands in the place of a value; a cut line is no JSON in the first place."""
    values = to_json(data.draw(st.from_type(kind)))
    changed = data.draw(st.sampled_from(sorted(values)))
    try:
        message = from_json({**values, changed: data.draw(JSON)})
    except (ValueError, TypeError):
        return
    assert type(message) is kind


def small_order(**more: Any) -> BuildOrder:
    mesh = Path("/h/a.obj")
    placement = Placement("mm", 1.0, "+Y", "+Z", (0.0, 0.0, 0.0), 120.0, 90.0)
    views = Views(((0.0, 0.0, 0.0),), (Camera.square(64, 85.0, 700.0),), (Look(),))
    return BuildOrder(
        *("u", Head("p1", "smile", "mesh", mesh, (mesh,)), "/d", views, ((0, 1, 2),), placement),
        *(np.zeros((0, 3)), "train", "files", "png"),
        **more,
    )


def test_an_order_says_nothing_of_what_it_does_not_use() -> None:
    assert to_json(small_order()) == {
        "is": "BuildOrder",
        "unit": "u",
        "head": {
            "subject": "p1", "expression": "smile", "source": "mesh", "mesh_path": "/h/a.obj",
            "files": ["/h/a.obj"],
        },
        "root": "/d",
        "views": {
            "poses": [[0.0, 0.0, 0.0]],
            "cameras": [{"width": 64, "height": 64, "lens_mm": 85.0, "distance_mm": 700.0}],
            "looks": [{}],
        },
        "indices": [[0, 1, 2]],
        "placement": {
            "units": "mm", "mm_per_unit": 1.0, "up": "+Y", "forward": "+Z", "pivot": [0.0, 0.0, 0.0],
            "radius_mm": 120.0, "eye_distance_mm": 90.0,
        },
        "anchors": {"dtype": "<f8", "shape": [0, 3], "data": ""},
        "split": "train",
        "images": "files",
        "image_format": "png",
    }  # fmt: skip
    assert to_json(VersionsOrder(Landmarks(min_confidence=0.75)))["landmarks"] == {"min_confidence": 0.75}


def test_where_parts_lie() -> None:
    order = small_order(earlier_units=("a", "b"))
    assert order.part_path == "data/train/part-u.parquet"
    assert order.earlier_paths == ("data/train/part-a.parquet", "data/train/part-b.parquet")


def test_expect_is_for_one_kind() -> None:
    receipt = Versions({"a": "1"})
    assert expect(Versions, receipt) is receipt
    for other in (
        Progressed(),
        OrderDone(),
        Rendered(0, "p"),
        LaneFailed("r", "k"),
        PlaceOrder((), "source"),
        None,
    ):
        with pytest.raises(TypeError, match=f"expected Versions, got {type(other).__name__}"):
            expect(Versions, other)
