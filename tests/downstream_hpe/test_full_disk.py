# SPDX-License-Identifier: MIT
"""A disk that is full is said in one line that names the file."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from downstream_hpe import cli
from downstream_hpe.errors import DataError
from downstream_hpe.prediction.records import COLUMNS, RecordWriter

FULL = Path("/dev/full")

pytestmark = pytest.mark.skipif(not FULL.exists(), reason="there is no /dev/full here")


def test_rows_that_do_not_fit_name_their_file(tmp_path: Path) -> None:
    table = tmp_path / "poses.csv"
    table.symlink_to(FULL)
    with (
        pytest.raises(DataError, match=r"poses\.csv: cannot be written \(No space left on device\)"),
        RecordWriter(table) as writer,
    ):
        writer.add(dict.fromkeys(COLUMNS, "a"))


def test_a_model_that_does_not_fit_names_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "pose.onnx"
    model.symlink_to(FULL)
    monkeypatch.setattr(sys, "argv", ["downstream-hpe", "export", "headturn", "--onnx", str(model)])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 1
    said = capsys.readouterr().err.replace("\n", "")
    assert "pose.onnx: cannot be written (No space left on device)" in said
