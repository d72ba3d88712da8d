# SPDX-License-Identifier: GPL-3.0-or-later
"""Every column is described once, and everything else follows: shown with a column that there is not."""

from __future__ import annotations

import sys
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import small_dataset

from generator.dataset.export.run import export_dataset
from generator.dataset.format.columns import (
    LOOKS,
    ROWS,
    SCHEMA_VERSION,
    Column,
    Compare,
    columns_at,
    list_of,
    version_number,
)
from generator.dataset.format.heads_table import HEADS, HeadRow, heads_schema, read_heads
from generator.dataset.format.manifest import read_manifest
from generator.dataset.format.open import as_array
from generator.dataset.format.part import read_part
from generator.dataset.format.schema import part_schema
from generator.dataset.format.unit_rows import unit_table
from generator.dataset.proof.compare import StoredFile, compared_columns, row_differences
from generator.dataset.proof.row_checks import ROW_CHECKS, row_checks
from generator.dataset.proof.verify import check_names, verify_dataset
from generator.dataset.show.column_tables import heads_table, rows_table

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

import make_docs  # noqa: E402

PART = "data/train/part-s1-0.parquet"


@pytest.mark.parametrize("column", [*ROWS.values(), *HEADS.values()], ids=lambda column: column.name)
def test_what_is_said_of_a_column_makes_sense(column: Column) -> None:
    whole = set(check_names()) | set(check_names(quick=True))
    assert callable(column.check) or column.check in whole
    assert column.meaning and "\n" not in column.meaning and "|" not in column.meaning
    assert version_number(column.since) <= version_number(SCHEMA_VERSION)
    assert column.since == "1.0.0" or column.default is not None, "a reader of 1.0 needs something to take"


def test_every_check_of_rows_is_some_columns() -> None:
    assert set(row_checks()) == set(ROW_CHECKS)
    assert check_names() == [
        "manifest", "heads and poses", "part files", "part hashes", "schema", "no nulls", "every row once",
        "identity", "rotation", "camera", "look", "landmarks", "anchors", "exact landmarks", "images",
        "passes", "digest",
    ]  # fmt: skip


def test_columns_of_a_version_are_those_of_its_time() -> None:
    later = {
        "projection",
        "landmarks_exact",
        "landmarks_visible",
        "passes_path",
        "passes_sha256",
        *LOOKS,
        "look_left_out",
    }
    assert {c.name for c in columns_at(ROWS, "1.0.0")} == set(ROWS) - later
    assert [c.name for c in columns_at(ROWS, "1.9.0")] == list(ROWS)
    assert [field.name for field in fields(HeadRow)] == heads_schema().names == list(HEADS)


def test_docs_are_what_the_tables_say() -> None:
    assert make_docs.stale() == []


def test_docs_that_were_edited_by_hand_are_found(tmp_path: Path, capsys, monkeypatch) -> None:
    for file in make_docs.DOCS:
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_bytes((ROOT / file).read_bytes())
    page = tmp_path / "docs" / "table.md"
    page.write_text(page.read_text(encoding="utf-8").replace("R_C, row-major", "a matrix"), encoding="utf-8")
    monkeypatch.setattr(make_docs, "ROOT", tmp_path)
    monkeypatch.setattr(make_docs.stale, "__defaults__", (tmp_path,))
    monkeypatch.setattr(make_docs.made, "__defaults__", (tmp_path,))
    monkeypatch.setattr(sys, "argv", ["make_docs.py", "--check"])
    assert make_docs.main() == 1
    assert capsys.readouterr().out == "docs/table.md: out of date; run python scripts/make_docs.py\n"
    monkeypatch.setattr(sys, "argv", ["make_docs.py"])
    assert make_docs.main() == 0
    assert page.read_bytes() == (ROOT / "docs/table.md").read_bytes()
    page.write_text("no marks", encoding="utf-8")
    with pytest.raises(ValueError, match=r"docs/table\.md: the marks of 'columns of the rows' are missing"):
        make_docs.made()


# -- a column more -----------------------------------------------------------------------------------


def gaze_problems(batch: pa.RecordBatch, context) -> list[str]:
    """It is a unit vector, and the context says whose."""
    off = np.abs(np.linalg.norm(as_array(batch, "gaze"), axis=1) - 1) > 1e-9
    names = [context.heads[place].subject for place in context.head_index[off]]
    return [f"the gaze of {name} has no direction" for name in names]


GAZE = Column(
    "gaze",
    list_of(pa.float64(), 3),
    "where the eyes look, frame C, length 1",
    gaze_problems,
    replay=Compare("floats", "units"),
    since=SCHEMA_VERSION,
    default=float("nan"),
)


@pytest.fixture
def looking(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A dataset with the column: the table knows it, and who makes the rows gives its values."""
    original = small_dataset.unit_rows

    def rows(*arguments, **options):
        unit = original(*arguments, **options)
        return replace(unit, extra={"gaze": unit.rotation @ [0.0, 0.0, -1.0]})

    monkeypatch.setitem(ROWS, "gaze", GAZE)
    monkeypatch.setattr(small_dataset, "unit_rows", rows)
    small_dataset.build_dataset(tmp_path / "d", "embedded")
    return tmp_path / "d"


def test_a_new_column_is_in_schema_part_and_verify(looking: Path) -> None:
    schema = part_schema("none", {}, "")
    assert schema.field("gaze").type == list_of(pa.float64(), 3) and not schema.field("gaze").nullable
    part = read_part(looking / PART)
    np.testing.assert_allclose(as_array(part, "gaze"), -as_array(part, "rotation")[:, [2, 5, 8]])
    report = verify_dataset(looking, workers=1)
    assert report.ok, report.text()
    assert "ok    gaze" in report.text()


def test_a_new_column_is_checked(looking: Path) -> None:
    from damage import failures, rewrite

    values = read_part(looking / PART)["gaze"].to_pylist()
    rewrite(looking, {"gaze": [[0.0, 0.0, 2.0], *values[1:]]}, honest=True)
    assert failures(verify_dataset(looking, workers=1)) == {"gaze": "the gaze of s1 has no direction"}


def test_a_new_column_is_in_card_docs_and_exports(looking: Path, tmp_path: Path) -> None:
    line = "| gaze | float64[3] | where the eyes look, frame C, length 1 |"
    assert line in (looking / "README.md").read_text()
    assert line in rows_table() and "gaze" not in heads_table()
    assert make_docs.stale() == ["docs/table.md"]
    export_dataset(looking, "huggingface", tmp_path / "out")
    text = (tmp_path / "out" / "README.md").read_text()
    assert line in text and "  - name: gaze\n    sequence: float64\n    length: 3\n" in text
    export_dataset(looking, "croissant", tmp_path / "c")
    said = (tmp_path / "c" / "croissant.json").read_text()
    assert '"description": "where the eyes look, frame C, length 1"' in said


def test_a_new_column_is_replayed(looking: Path) -> None:
    assert compared_columns()["gaze"] == Compare("floats", "units")
    row = read_part(looking / PART).to_pylist()[0]
    assert row_differences(row, row) == []
    moved = {**row, "gaze": [row["gaze"][0] + 0.25, *row["gaze"][1:]]}
    assert row_differences(row, moved) == ["gaze differ: up to 0.25 units"]


def test_a_dataset_without_it_is_older(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    small_dataset.build_dataset(tmp_path / "d")
    assert verify_dataset(tmp_path / "d").ok
    monkeypatch.setitem(ROWS, "gaze", replace(GAZE, since="1.9.0"))
    monkeypatch.setattr("generator.dataset.format.defaults.SCHEMA_VERSION", "1.9.0")
    assert "gaze" not in pq.read_schema(tmp_path / "d" / PART).names
    assert np.isnan(as_array(read_part(tmp_path / "d" / PART), "gaze")).all()
    report = verify_dataset(tmp_path / "d", workers=1)
    assert report.ok, report.text()
    assert (
        read_manifest(tmp_path / "d").schema_version == SCHEMA_VERSION
        and len(read_heads(tmp_path / "d")) == 2
    )


def test_a_unit_without_its_values_is_refused(rows, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(ROWS, "gaze", GAZE)
    with pytest.raises(KeyError, match="gaze"):
        unit_table(rows, part_schema("none", {}, ""))


# -- replay ------------------------------------------------------------------------------------------


def test_what_is_compared_and_how_it_is_said(rows) -> None:
    assert list(compared_columns()) == [
        "rotation", "camera", "translation_mm", "projection", *LOOKS, "look_left_out", "detected",
        "landmarks", "landmarks_exact", "landmarks_visible", "width", "height", "image_sha256",
        "passes_sha256",
    ]  # fmt: skip
    row = unit_table(rows, part_schema("none", {}, "")).to_pylist()[0]
    assert row_differences(row, row) == []
    now = {
        **row,
        "detected": False,
        "landmarks": [float("nan")] * 1404,
        "landmarks_exact": [row["landmarks_exact"][0] + 0.5, *row["landmarks_exact"][1:]],
        "landmarks_visible": [not flag for flag in row["landmarks_visible"]],
        "projection": "orthographic",
        "image_sha256": "1" * 64,
        "passes_sha256": "2" * 64,
        "image_path": "elsewhere",
    }
    assert row_differences(row, now) == [
        "projection differs",
        "detected was True, is False",
        "landmarks differ",
        "landmarks_exact differ: up to 0.5 mm",
        "landmarks_visible differ: 468 of them",
        "the image differs",
        "the floats of the passes differ",
    ]


@pytest.mark.parametrize(
    ("file", "then", "now", "said"),
    [
        ("a", "a", "a", None),
        ("a", "a", "b", "the image differs: far"),
        ("b", "a", "a", "a.png was changed after the build: far; what is rendered now has the recorded hash"),
        ("b", "a", "b", "a.png is what is rendered now; the hash in its row is not its own and was changed"),
        ("c", "a", "b", "a.png has not the hash in its row, and what is rendered now has neither's: far"),
    ],
)
def test_file_row_and_what_is_rendered_now(rows, file: str, then: str, now: str, said: str | None) -> None:
    row = unit_table(rows, part_schema("none", {}, "")).to_pylist()[0]
    stored = {"image_sha256": StoredFile("a.png", file, lambda: ": far")}
    found = row_differences({**row, "image_sha256": then}, {**row, "image_sha256": now}, stored)
    assert [line.removesuffix(": file, row or both were changed") for line in found] == (
        [said] if said else []
    )


def test_numbers_that_are_not_as_many_differ_by_none(rows) -> None:
    row = unit_table(rows, part_schema("none", {}, "")).to_pylist()[0]
    few = {**row, "landmarks_exact": row["landmarks_exact"][:4]}
    assert row_differences(row, few) == ["landmarks_exact differ"]
    x, y, *rest = row["landmarks_exact"]
    moved = {**row, "landmarks_exact": [x + 0.25, y - 0.5, *rest]}
    assert row_differences(row, moved) == ["landmarks_exact differ: up to 0.5 mm"]
