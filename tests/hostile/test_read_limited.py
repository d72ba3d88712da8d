# SPDX-License-Identifier: GPL-3.0-or-later
"""A file is read for what it holds, not for what it might: found by make fuzz under a limit of memory."""

from __future__ import annotations

import os
import tracemalloc
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import downstream_hpe.reading
import generator.reading

MODULES = (generator.reading, downstream_hpe.reading)


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_a_small_file_takes_little_whatever_its_limit(module: Any, tmp_path: Path) -> None:
    (tmp_path / "a").write_bytes(b"ten bytes.")
    tracemalloc.start()
    try:
        assert module.read_limited(tmp_path / "a", 1 << 30) == b"ten bytes."
        assert tracemalloc.get_traced_memory()[1] < 8 << 20
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__)
def test_a_file_that_grows_while_it_is_read_is_read_to_its_end_or_refused(
    module: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "a"
    file.write_bytes(b"1")
    grown = b"1" * (3 << 20)
    _grow_after_the_look(module, file, grown, monkeypatch)
    assert module.read_limited(file, 4 << 20) == grown
    file.write_bytes(b"1")
    with pytest.raises(ValueError):
        module.read_limited(file, 2 << 20)


def _grow_after_the_look(
    module: ModuleType, file: Path, content: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = os.open

    def open_grown(path: Any, *rest: Any) -> int:
        file.write_bytes(content)
        return real(path, *rest)

    monkeypatch.setattr(module.os, "open", open_grown)  # type: ignore[attr-defined]
