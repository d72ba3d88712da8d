# SPDX-License-Identifier: GPL-3.0-or-later
"""Names that rich would take for markup are shown as they are."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from generator.cli.app import app


@pytest.mark.parametrize("name", ["Anna [v2]", "a[/b]", "[red]x"])
def test_heads_list_shows_brackets(tmp_path: Path, name: str) -> None:
    folder = tmp_path / name
    folder.mkdir(parents=True)
    (folder / "head.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    result = CliRunner().invoke(app, ["heads", "list", str(folder)])
    assert result.exit_code == 0, result.output
    assert name.rpartition("/")[2] + "  " in result.output
