# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands in this process, and a small dataset to put strangers' files into."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hostile_command import Command

sys.path.append(str(Path(__file__).resolve().parents[1] / "dataset"))


@pytest.fixture
def command(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Iterator[Command]:
    """headturn or downstream-hpe; whatever it raises but SystemExit is a traceback and fails the test."""

    def run(*words: str | Path) -> tuple[int, str]:
        from downstream_hpe import cli as hpe
        from generator import cli as headturn

        monkeypatch.setattr(sys, "argv", [*map(str, words)])
        capfd.readouterr()
        with pytest.raises(SystemExit) as stopped:
            (headturn.main if words[0] == "headturn" else hpe.main)()
        code = stopped.value.code
        return (0 if code is None else int(code)), capfd.readouterr().err

    yield run


@pytest.fixture(scope="session")
def whole_dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Nobody changes it: see :func:`shutil.copytree`."""
    from small_dataset import build_dataset

    root = tmp_path_factory.mktemp("whole") / "dataset"
    build_dataset(root)
    return root
