# SPDX-License-Identifier: MIT
"""Ctrl-C is one line, which says what goes on where it ended."""

from __future__ import annotations

import sys

import pytest

from downstream_hpe.cli.console import one_line_errors


@pytest.mark.parametrize(("command", "further"), [("fit", True), ("predict", False)])
def test_only_what_goes_on_is_said_to(
    command: str, further: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["downstream-hpe", command, "x"])
    with pytest.raises(SystemExit) as stopped, one_line_errors():
        raise KeyboardInterrupt
    assert stopped.value.code == 130
    again = "; run the same command again to continue" if further else ""
    assert capsys.readouterr().err == f"downstream-hpe: stopped{again}\n"
