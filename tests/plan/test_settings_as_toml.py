# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever the settings are: TOML and back are the same settings, and their places the same places."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from legal_settings import any_value, inner, values

from generator.errors import UsageError
from generator.plan.config import BuildConfig, config_toml, differences, load_config, read_recorded
from generator.plan.setting import Setting
from generator.plan.settings import Values, all_settings, beyond_defaults, plain, with_defaults

SETTINGS = list(all_settings())
NAMES = [known.name for known in SETTINGS]


def read(text: str, folder: Path) -> BuildConfig:
    """A configuration as from a file."""
    file = folder / "config.toml"
    file.write_bytes(text.encode())
    return load_config(file, {})


@given(values())
def test_toml_and_back(given_values: Values) -> None:
    config = load_config(None, given_values)
    with tempfile.TemporaryDirectory() as folder:
        again = read(config_toml(config), Path(folder))
    assert again == config
    assert repr(again.as_dict()) == repr(config.as_dict()), "with the same types"
    assert config_toml(again) == config_toml(config)


@given(values())
def test_what_was_given_is_what_is_there(given_values: Values) -> None:
    config = load_config(None, given_values)
    for known in SETTINGS:
        value = getattr(getattr(config, known.section), known.key)
        assert value == given_values.get(known.section, {}).get(known.key, known.default)
        assert isinstance(value, tuple) or not isinstance(value, list), "nothing in it can be changed"
    every = with_defaults(given_values)
    assert config.as_dict() == {
        name: {k: plain(v) for k, v in table.items()} for name, table in every.items()
    }
    used = beyond_defaults(config.as_dict(), lambda known: True)
    changed = {
        known.name for known in SETTINGS if plain(every[known.section][known.key]) != plain(known.default)
    }
    assert used.keys() == changed
    assert set(differences(config, load_config(None, {}))) <= changed


@pytest.mark.parametrize("known", SETTINGS, ids=NAMES)
def test_limits_are_those_of_the_table(known: Setting) -> None:
    info = known.info

    def refused(number: float) -> bool:
        value: Any = number
        if isinstance(known.default, tuple):
            value = [number] * len(known.default)
        try:
            load_config(None, {known.section: {known.key: value}})
        except UsageError as error:
            assert known.name in str(error) and "\n" not in str(error)
            return True
        return False

    step = 1 if inner(known.kind) is int else 1e-9
    for limit, outside in ((info.low, -step), (info.high, step)):
        if limit is not None:
            number = int(limit) if inner(known.kind) is int else float(limit)
            assert not refused(number), "the limit itself is legal"
            assert refused(number + outside * max(1, abs(number)))
    if info.above is not None:
        assert refused(info.above) and not refused(info.above + 1e-9)


@pytest.mark.parametrize("known", [s for s in SETTINGS if s.choices], ids=lambda known: known.name)
def test_choices_are_those_of_the_table(known: Setting) -> None:
    wrap = (lambda value: [value]) if isinstance(known.default, tuple) else (lambda value: value)
    for choice in known.choices:
        load_config(None, {known.section: {known.key: wrap(choice.value)}})
    with pytest.raises(UsageError, match=known.name):
        load_config(None, {known.section: {known.key: wrap("nothing of the kind")}})


@pytest.mark.parametrize("known", SETTINGS, ids=NAMES)
@given(data=st.data())
def test_a_default_is_legal_and_a_wrong_type_is_not(known: Setting, data: st.DataObject) -> None:
    load_config(None, {known.section: {known.key: known.default}})
    wrong = data.draw(st.sampled_from([{"a": 1}, [["x"]], object()]))
    with pytest.raises(UsageError, match=known.name):
        load_config(None, {known.section: {known.key: wrong}})
    load_config(None, {known.section: {known.key: data.draw(any_value(known))}})


PART = st.sampled_from(["heads", "..", "a b", "x.y", "."])
RELATIVE = st.lists(PART, min_size=1, max_size=4).map("/".join)


@given(RELATIVE, RELATIVE, RELATIVE, RELATIVE)
def test_a_dataset_names_the_same_places_wherever_it_lies(
    base: str, root: str, heads: str, poses: str
) -> None:
    """Read from the folder of the dataset, its configuration means what it meant where it was built."""
    with tempfile.TemporaryDirectory() as folder:
        top = Path(folder) / "deep" / "deep" / "deep" / "deep" / "deep"
        given_values = {"heads": {"source": heads}, "poses": {"kind": "csv", "path": poses}}
        (top / base).mkdir(parents=True, exist_ok=True)
        (top / root).mkdir(parents=True, exist_ok=True)
        file = top / base / "build.toml"
        file.write_bytes(config_toml(load_config(None, given_values)).encode())
        config = load_config(file, {})
        (top / root / "config.toml").write_bytes(config_toml(config.moved_to(top / root)).encode())
        again = read_recorded(top / root / "config.toml")
        assert again.located(again.heads.source) == config.located(heads)
        assert again.located(again.poses.path or "") == config.located(poses)
        assert not differences(config, again)
        assert again.moved_to(top / root) == again, "and it stays so"
