# SPDX-License-Identifier: GPL-3.0-or-later
"""Any legal value of every setting, made from their table: what is added there is tried, too."""

from __future__ import annotations

from typing import Any, get_args, get_origin

from hypothesis import strategies as st

from generator.plan.setting import Setting
from generator.plan.settings import Values, all_settings

TEXT = st.text(max_size=12)


def inner(kind: Any) -> Any:
    """The type without its None."""
    arguments = [one for one in get_args(kind) if one is not type(None)]
    return arguments[0] if type(None) in get_args(kind) else kind


def value_of(known: Setting, text: st.SearchStrategy[str] = TEXT) -> st.SearchStrategy[Any]:
    """Legal values, except None. text: where everything goes."""
    kind = inner(known.kind)
    choices = [choice.value for choice in known.choices]
    if get_origin(kind) is not tuple:
        return _single(known, kind, choices, text)
    first, *rest = get_args(kind)
    one = _single(known, first, choices, text)
    if rest == [...]:
        # A range is two or three numbers; what it means is for the plan of poses to say.
        most, least = (3, 2) if first is float else (4, 0)
        return st.lists(one, min_size=least, max_size=most, unique=bool(choices)).map(tuple)
    return st.tuples(*[one] * len(get_args(kind)))


def any_value(known: Setting) -> st.SearchStrategy[Any]:
    """Legal values, also None where that is one."""
    legal = value_of(known)
    return st.none() | legal if type(None) in get_args(known.kind) else legal


@st.composite
def values(draw: st.DrawFn) -> Values:
    """Some settings of some sections."""
    found: Values = {}
    for known in all_settings():
        if draw(st.booleans()):
            found.setdefault(known.section, {})[known.key] = draw(any_value(known))
    return found


def _single(
    known: Setting, kind: Any, choices: list[str], text: st.SearchStrategy[str]
) -> st.SearchStrategy[Any]:
    info = known.info
    if known.name == "render.variety":
        return st.just("none")  # others are the names of what other settings are
    if choices:
        return st.sampled_from(choices)
    if kind is bool:
        return st.booleans()
    if kind is int:
        # TOML has whole numbers of 64 bits.
        return st.integers(-(2**63) if info.low is None else int(info.low), int(info.high or 2**63 - 1))
    if kind is float:
        low = info.low if info.above is None else info.above
        return st.floats(
            low, info.high, exclude_min=info.above is not None, allow_nan=False, allow_infinity=False
        )
    if kind is str:
        return text
    raise TypeError(f"{known.name}: say here which values a {kind} may have")
