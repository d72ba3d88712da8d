# SPDX-License-Identifier: MIT
"""scripts/worn.py: a line of its table a kind of thing that heads wear."""

from __future__ import annotations

import sys

import ideal
import numpy as np
import pytest

from downstream_hpe.tables.columns import WORN
from scripts import worn

pytest.importorskip("onnxruntime")


def run(*arguments, monkeypatch):
    """Exit code of the script."""
    monkeypatch.setattr(sys, "argv", ["worn.py", *map(str, arguments)])
    try:
        worn.main()
    except SystemExit as stopped:
        return stopped.code
    return 0


@pytest.fixture
def columns():
    """125 rows: 25 in masks, 50 in glasses, 10 of these in both; one of the masked is not detected."""
    found = ideal.rows(ideal.Faces().draw(1, np.random.default_rng(1))[0], "s")
    found |= {f"look_{kind}": np.array(["own" if kind == "beard" else "none"] * 125) for kind in WORN}
    found["look_mask"] = np.array(["cloth"] * 25 + ["none"] * 100)
    found["look_glasses"] = np.array(["none"] * 15 + ["round"] * 50 + ["none"] * 60)
    found["detected"][0] = False
    return found


def test_each_kind_has_a_line(columns, tmp_path, monkeypatch, capsys):
    ideal.write(tmp_path / "data" / "part.parquet", columns)
    assert run(tmp_path, tmp_path, monkeypatch=monkeypatch) == 0
    said = capsys.readouterr().out
    lines = [line.split(" | ")[:2] for line in said.split("\n\n")[0].splitlines()[2:]]
    assert lines == [["| all", "248"], ["| none of these", "120"], ["| mask", "48"], ["| glasses", "100"]]
    assert "| confidence | rows | mean confidence | share below 5° |" in said


def test_a_table_that_does_not_know_is_one_line(columns, tmp_path, monkeypatch, capsys):
    del columns["look_mask"]
    ideal.write(tmp_path / "data" / "part.parquet", columns)
    assert run(tmp_path, monkeypatch=monkeypatch) == 1
    error = capsys.readouterr().err
    assert "no column look_mask" in error
    assert error.count("\n") == 1
