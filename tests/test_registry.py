# SPDX-License-Identifier: GPL-3.0-or-later
"""Things by name: imported when they are asked for, refused with the names there are."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from generator import registries
from generator.errors import UsageError
from generator.registry import Registry

ROOT = Path(__file__).resolve().parents[1]
REGISTRIES = {name: value for name, value in vars(registries).items() if isinstance(value, Registry)}
ENTRIES = [(name, entry) for name, registry in REGISTRIES.items() for entry in registry]


def test_names_keep_their_order() -> None:
    registry: Registry[object] = Registry("--kind", {"b": "math:pi", "a": "math:e"})
    assert registry.names == tuple(registry) == ("b", "a")
    assert len(registry) == 2 and "a" in registry and "c" not in registry and 3 not in registry


def test_nothing_is_imported_before_it_is_asked_for() -> None:
    registry: Registry[object] = Registry("--kind", {"pi": "math:pi", "bad": "no_such_module:x"})
    assert registry.get("pi") == pytest.approx(3.14159, abs=1e-5)
    with pytest.raises(ModuleNotFoundError, match="no_such_module"):
        registry.get("bad")


def test_an_unknown_name_is_one_line_with_those_there_are() -> None:
    registry: Registry[object] = Registry("--kind", {"b": "math:pi", "a": "math:e"})
    with pytest.raises(UsageError, match=r"^--kind 'c': expected one of b, a$"):
        registry.get("c")


def test_more_may_be_added_and_taken_away() -> None:
    registry: Registry[object] = Registry("--kind", {"a": "math:e"})
    thing = object()
    registry.add("thing", thing)
    registry.add("tau", "math:tau")
    registry.add("a", "math:pi")  # in the place of the one that was there
    assert registry.names == ("a", "thing", "tau")
    assert registry.get("thing") is thing
    assert registry.get("tau") == pytest.approx(2 * registry.get("a"))  # type: ignore[operator]
    registry.remove("thing")
    assert "thing" not in registry
    with pytest.raises(KeyError):
        registry.remove("thing")


def test_what_is_added_is_not_added_to_the_entries_it_was_made_from() -> None:
    entries = {"a": "math:e"}
    Registry("--kind", entries).add("b", "math:pi")
    assert entries == {"a": "math:e"}


@pytest.mark.parametrize(("name", "entry"), ENTRIES, ids=["-".join(entry) for entry in ENTRIES])
def test_every_entry_is_there(name: str, entry: str) -> None:
    try:
        assert REGISTRIES[name].get(entry) is not None
    except ModuleNotFoundError as error:
        assert error.name and not error.name.startswith("generator")
        pytest.skip(f"needs {error.name}")


def test_the_lists_alone_import_nothing() -> None:
    """Blender's panel shows names while none of the libraries is there."""
    program = (
        "import sys; from generator import registries; loaded = list(sys.modules)\n"
        "print([name for name in loaded if name.split('.')[0] in ('numpy', 'pyarrow', 'pydantic', 'cv2')])\n"
        "print([name for name in loaded if name.startswith('generator.')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True
    )
    heavy, ours = map(eval, done.stdout.splitlines())
    assert heavy == []
    assert sorted(ours) == ["generator.errors", "generator.registries", "generator.registry"]
