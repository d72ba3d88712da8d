# SPDX-License-Identifier: GPL-3.0-or-later
"""Datasets of every 1.x: read, verified, reported, exported, compacted, and rewritten to today's."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
import typer
from other_versions import ROWS_1_0, as_schema_1_0, as_schema_1_1, as_schema_1_9
from typer.testing import CliRunner

from generator.cli import upgrade as cli_upgrade
from generator.dataset.export.options import ExportOptions
from generator.dataset.export.run import export_dataset
from generator.dataset.format.anchors_table import read_anchors
from generator.dataset.format.columns import ROWS, SCHEMA_VERSION, Column
from generator.dataset.format.compact import compact_dataset
from generator.dataset.format.digest import content_digest
from generator.dataset.format.heads_table import read_heads
from generator.dataset.format.manifest import read_manifest, write_manifest
from generator.dataset.format.missing import fill_missing
from generator.dataset.format.open import as_array, read_rows, read_samples
from generator.dataset.format.part import iter_part, iter_stored, read_part
from generator.dataset.format.schema import part_schema
from generator.dataset.format.upgrade import upgrade_dataset
from generator.dataset.proof.verify import verify_dataset
from generator.dataset.show.card import dataset_card
from generator.dataset.show.pictures import anchor_sheet, contact_sheet, detection_map
from generator.dataset.show.report.page import report_data
from generator.errors import DatasetError
from generator.registries import FORMATS

PART = "data/train/part-s1-0.parquet"


class Quiet:
    def stage(self, name: str, total: int) -> None: ...

    def advance(self, steps: int = 1) -> None: ...


def columns_of(root: Path) -> list[tuple[str, Column]]:
    """Columns of the rows that a dataset's first part has."""
    return [(name, ROWS[name]) for name in pq.read_schema(root / PART).names]


@pytest.fixture
def old(dataset: Path) -> Path:
    """The dataset as schema 1.0 would have had it."""
    return as_schema_1_0(dataset)


@pytest.fixture
def future(dataset: Path) -> Path:
    """The dataset as a schema 1.9 may have it."""
    return as_schema_1_9(dataset)


def test_what_1_0_lacks_holds_its_default(old: Path) -> None:
    assert pq.read_schema(old / PART).names == list(ROWS_1_0)
    table = read_part(old / PART)
    assert table.schema.names == [name for name in ROWS if name != "image"]
    assert table.schema.equals(part_schema("files", {}, ""))
    assert table.schema.metadata[b"headturn.schema_version"] == SCHEMA_VERSION.encode()
    assert set(table["projection"].to_pylist()) == {"perspective"}
    assert np.isnan(as_array(table, "landmarks_exact")).all()
    assert as_array(table, "landmarks_exact").shape == (10, 468, 3)
    assert not as_array(table, "landmarks_visible").any()
    assert set(table["passes_path"].to_pylist()) == set(table["passes_sha256"].to_pylist()) == {""}
    assert pa.Table.from_batches(iter_part(old / PART)).schema.names == table.schema.names
    assert pa.Table.from_batches(iter_stored(old / PART)).schema.names == list(ROWS_1_0)
    for name in ROWS_1_0:
        assert content_digest(table.select([name])) == content_digest(
            pq.read_table(old / PART).select([name])
        )


def test_rows_of_1_0_by_columns_filters_and_names(old: Path) -> None:
    manifest = read_manifest(old)
    names = ["passes_path", "sample_id", "landmarks_visible"]
    batches = list(read_rows(old, manifest.parts, names))
    assert sum(map(len, batches)) == 36 and all(batch.schema.names == names for batch in batches)
    [lonely] = read_rows(old, manifest.parts[:1], ["projection"])
    assert lonely.schema.names == ["projection"] and len(lonely) == 10
    found = list(read_rows(old, manifest.parts, None, ~pc.field("detected")))
    assert sum(map(len, found)) == 4 and "landmarks_exact" in found[0].schema.names
    row = read_samples(old, manifest, ["s1/neutral/y-30_p-20_r+0"])["s1/neutral/y-30_p-20_r+0"]
    assert row["projection"] == "perspective" and np.isnan(row["landmarks_exact"]).all()


def test_missing_landmarks_of_1_0(old: Path) -> None:
    table = pq.read_table(old / PART)
    for choice, filled in (("keep", 0), ("exact", 0), ("frontal", 10)):
        landmarks, origin = fill_missing(table, choice)
        assert landmarks.shape == (10, 468, 3)
        assert np.isfinite(landmarks).all(axis=(1, 2)).sum() == (filled or (origin == "detected").sum())
    stripped = table.replace_schema_metadata(None)
    assert (fill_missing(stripped, "keep")[1] == fill_missing(table, "keep")[1]).all()


def test_heads_and_anchors_of_1_0(old: Path) -> None:
    head = read_heads(old)[0]
    assert (head.projection, head.frame, head.anchor_views, head.anchor_absent) == (
        *("perspective", "source"),
        *(0, 468),
    )
    assert np.isnan(head.correction_sd_deg).all() and head.pivot == (0.0, 1.5, -2.25)
    anchors = read_anchors(old)
    assert set(anchors) == {("s1", "neutral"), ("s2", "neutral")}
    assert (
        np.isnan(anchors["s1", "neutral"].points).all() and (anchors["s1", "neutral"].triangles == -1).all()
    )


@pytest.mark.slow
def test_1_0_is_proved_against_its_own_columns(old: Path) -> None:
    for quick in (False, True):
        report = verify_dataset(old, quick=quick)
        assert report.ok, report.text()
        assert not {"anchors", "exact landmarks", "passes"} & {check.name for check in report.checks}
        assert "exact landmarks give" not in report.text()
    assert verify_dataset(old, workers=2).as_dict() == verify_dataset(old, workers=1).as_dict()
    pq.write_table(pq.read_table(old / PART).drop_columns(["quaternion"]), old / PART)
    [wrong] = [check for check in verify_dataset(old).checks if check.name == "schema"]
    assert wrong.detail == f"{PART}: columns differ from schema 1.0.0: quaternion"


def test_1_0_is_shown(old: Path, tmp_path: Path) -> None:
    data = report_data(old, lambda _: None)
    assert "it was made before they were recorded (schema 1.0)" in data["why_no_atlas"]
    assert data["heads"][0]["anchors"] == 0 and data["sheet"]["tiles"][0][0]["exact"] == []
    manifest = read_manifest(old)
    for picture in (contact_sheet, anchor_sheet, detection_map):
        assert picture(old, manifest, tmp_path / "p.png").is_file()
    card = dataset_card(manifest, read_heads(old))
    assert "| rotation |" in card and "| landmarks_exact |" not in card.split("## Conventions")[0]


@pytest.mark.parametrize("name", FORMATS)
def test_1_0_is_exported_in_every_form(old: Path, tmp_path: Path, name: str) -> None:
    done = export_dataset(old, name, tmp_path / "out", ExportOptions(missing="skip"))
    assert done.rows == 32 and done.landmarks in ("", "detected")
    for path in (tmp_path / "out").rglob("part-*.parquet"):
        schema = pq.read_schema(path)
        assert schema.metadata[b"headturn.schema_version"] == SCHEMA_VERSION.encode()
        assert {"projection", "landmarks_exact", "image"} <= set(schema.names)


@pytest.mark.parametrize("version", ["old", "future"])
def test_compact_loses_nothing(version: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    root = request.getfixturevalue(version)
    before = read_manifest(root)
    after = compact_dataset(root, tmp_path / "c", reporter=Quiet())
    assert (after.digest, after.schema_version) == (before.digest, before.schema_version)
    assert after.others == before.others == ({"weather": {"sun": True}} if version == "future" else {})
    report = verify_dataset(tmp_path / "c")
    assert report.ok, report.text()
    names = pq.read_schema(tmp_path / "c" / after.parts[0].path).names
    assert names == pq.read_schema(root / before.parts[0].path).names


def test_columns_of_a_later_schema_are_left_alone(future: Path, tmp_path: Path) -> None:
    for quick in (False, True):
        report = verify_dataset(future, quick=quick)
        assert report.ok, report.text()
    assert [head.subject for head in read_heads(future)] == ["s1", "s2"]
    assert report_data(future, lambda _: None)["rows"] == 36
    assert "gaze" in next(read_rows(future, read_manifest(future).parts)).schema.names
    export_dataset(future, "huggingface", tmp_path / "out")
    part = min((tmp_path / "out" / "data" / "train").iterdir())
    np.testing.assert_array_equal(as_array(pq.read_table(part), "gaze")[:, 0], np.arange(0.0, 20, 2))
    assert pq.read_table(tmp_path / "out" / "heads.parquet")["hat"].to_pylist() == ["none", "none"]
    # What we do know has to be right all the same.
    pq.write_table(pq.read_table(future / PART).drop_columns(["quaternion"]), future / PART)
    [wrong] = [check for check in verify_dataset(future).checks if check.name == "schema"]
    assert wrong.detail == f"{PART}: columns differ from schema 1.9.0: quaternion"


def test_a_column_that_cannot_be_hashed_is_a_line_of_the_report(future: Path) -> None:
    table = pq.read_table(future / PART)
    odd = pa.array([[1.0]] * len(table), pa.list_(pa.float64()))
    pq.write_table(table.append_column("odd", odd), future / PART)
    report = verify_dataset(future)
    [wrong] = [check for check in report.checks if check.name == "part hashes"]
    assert "no canonical encoding" in wrong.detail and "\n" not in wrong.detail


@pytest.mark.parametrize("version", ["2.0.0", "0.9.0", "none", "1.1", ""])
def test_another_major_version_is_refused_in_one_line(dataset: Path, version: str) -> None:
    values = json.loads((dataset / "manifest.json").read_text())
    (dataset / "manifest.json").write_text(json.dumps({**values, "schema_version": version}))
    with pytest.raises(DatasetError, match=r"expected 1\.x; build it again") as error:
        read_manifest(dataset)
    assert "\n" not in str(error.value)


# -- upgrade ---------------------------------------------------------------------------------------


def checked(root: Path, rows: pa.Table) -> None:
    """root is a whole dataset of today, with the rows it had."""
    report = verify_dataset(root)
    assert report.ok, report.text()
    assert {"anchors", "exact landmarks"} <= {check.name for check in report.checks}
    manifest = read_manifest(root)
    assert manifest.schema_version == SCHEMA_VERSION
    assert manifest.digest == json.loads((root / "manifest.json").read_text())["digest"]
    now = pq.read_table(root / "data").select(list(ROWS_1_0)).sort_by("sample_id")
    assert content_digest(now) == content_digest(rows)
    assert not [path for path in root.parent.iterdir() if path.name.startswith(".")]


def rows_of(root: Path) -> pa.Table:
    return pq.read_table(root / "data").select(list(ROWS_1_0)).sort_by("sample_id")


def test_upgrade_beside(old: Path, tmp_path: Path) -> None:
    rows, files = rows_of(old), sorted(path.relative_to(old) for path in old.rglob("*"))
    before = read_manifest(old)
    done = upgrade_dataset(old, tmp_path / "new", reporter=Quiet())
    assert (done.changed, done.before, done.root) == (True, "1.0.0", tmp_path / "new")
    checked(tmp_path / "new", rows)
    assert done.manifest.digest != before.digest
    assert [p.path for p in done.manifest.parts] == [p.path for p in before.parts]
    assert sorted(path.relative_to(old) for path in old.rglob("*")) == files and read_manifest(old) == before
    assert "| landmarks_exact |" in (tmp_path / "new" / "README.md").read_text()
    with pytest.raises(DatasetError, match="exists; choose another --out"):
        upgrade_dataset(old, tmp_path / "new", reporter=Quiet())


def test_upgrade_in_place_and_again(old: Path) -> None:
    rows = rows_of(old)
    assert upgrade_dataset(old, reporter=Quiet()).root == old
    checked(old, rows)
    before = {path: path.stat().st_mtime_ns for path in old.rglob("*")}
    again = upgrade_dataset(old, reporter=Quiet())
    assert not again.changed and {path: path.stat().st_mtime_ns for path in old.rglob("*")} == before


def test_upgrade_where_only_heads_got_a_column(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Parts are rewritten all the same: what version they are of stands in each."""
    before = as_schema_1_1(dataset)
    assert "anchor_way" not in pq.read_schema(before / "heads.parquet").names
    monkeypatch.setattr("generator.dataset.format.defaults.ROWS", dict(columns_of(before)))
    upgrade_dataset(before, reporter=Quiet())
    metadata = pq.read_schema(before / PART).metadata
    assert metadata[b"headturn.schema_version"].decode() == SCHEMA_VERSION
    assert {head.anchor_way for head in read_heads(before)} == {"head"}


def test_upgrade_of_1_1(dataset: Path) -> None:
    before = as_schema_1_1(dataset)
    rows = rows_of(before)
    assert upgrade_dataset(before, reporter=Quiet()).before == "1.1.0"
    checked(before, rows)


def test_upgrade_through_a_link(old: Path, tmp_path: Path) -> None:
    rows = rows_of(old)
    (tmp_path / "link").symlink_to(old)
    upgrade_dataset(tmp_path / "link", reporter=Quiet())
    assert (tmp_path / "link").is_symlink()
    checked(old, rows)


def test_a_later_schema_is_not_upgraded(future: Path) -> None:
    assert not upgrade_dataset(future, reporter=Quiet()).changed
    assert read_manifest(future).schema_version == "1.9.0"


def test_upgrade_of_damaged_data_changes_nothing(old: Path) -> None:
    table = pq.read_table(old / PART)
    place = table.schema.get_field_index("yaw_deg")
    wrong = table.set_column(place, table.schema.field(place), pa.array([1.0] * len(table)))
    pq.write_table(wrong, old / PART)
    with pytest.raises(DatasetError, match=r"part-s1-0\.parquet: holds other values than its manifest says"):
        upgrade_dataset(old, reporter=Quiet())
    assert read_manifest(old).schema_version == "1.0.0"
    assert [path.name for path in old.parent.iterdir()] == [old.name]


KILLED = """
import os, sys
from pathlib import Path
from generator.dataset.format import upgrade
root, when, place = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
calls = 0
def dying(function):
    def call(*arguments, **options):
        global calls
        calls += 1
        if calls == place:
            os._exit(9)
        return function(*arguments, **options)
    return call
if when == "part":
    upgrade._rewrite = dying(upgrade._rewrite)
elif when == "rename":
    Path.rename = dying(Path.rename)
else:
    upgrade.shutil.rmtree = dying(upgrade.shutil.rmtree)
class Quiet:
    def stage(self, name, total): ...
    def advance(self, steps=1): ...
upgrade.upgrade_dataset(root, reporter=Quiet())
"""


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="a process that ends at once")
@pytest.mark.parametrize(
    ("when", "place"),
    [("part", 3), ("rename", 1), ("rename", 2), ("rename", 3), *(("rmtree", k) for k in (3, 4, 5))],
)
def test_a_killed_upgrade_loses_nothing(old: Path, when: str, place: int) -> None:
    rows = rows_of(old)
    done = subprocess.run(
        [sys.executable, "-c", KILLED, str(old), when, str(place)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 9, done.stderr
    upgrade_dataset(old, reporter=Quiet())
    checked(old, rows)


def test_a_place_that_cannot_be_taken(old: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    original = Path.rename

    def busy(self: Path, target: Path) -> Path:
        if self == old:
            raise OSError(16, "Device or resource busy")
        return original(self, target)

    monkeypatch.setattr(Path, "rename", busy)
    with pytest.raises(
        DatasetError, match=r"Device or resource busy\); nothing was changed\. Write it beside"
    ):
        upgrade_dataset(old, reporter=Quiet())
    assert read_manifest(old).schema_version == "1.0.0"
    assert [path.name for path in old.parent.iterdir()] == [old.name]


def test_the_command(old: Path, tmp_path: Path) -> None:
    app = typer.Typer()
    cli_upgrade.register(app)
    app.command("other")(lambda: None)  # a program of one command has no subcommands
    copy = tmp_path / "copy"
    shutil.copytree(old, copy)
    said = CliRunner().invoke(app, ["upgrade", str(old), "--out", str(tmp_path / "new")])
    assert said.exit_code == 0, said.output
    assert f"schema 1.0.0 -> {SCHEMA_VERSION}, 36 rows, digest {read_manifest(tmp_path / 'new').digest}" in (
        " ".join(said.output.split())
    )
    said = CliRunner().invoke(app, ["upgrade", str(copy), "--json"])
    assert json.loads(said.stdout) == {
        "dataset": str(copy),
        "changed": True,
        "before": "1.0.0",
        "schema_version": SCHEMA_VERSION,
        "digest": read_manifest(tmp_path / "new").digest,
    }
    said = CliRunner().invoke(app, ["upgrade", str(copy)])
    assert said.exit_code == 0 and f"of schema {SCHEMA_VERSION} already, nothing to do" in said.output


def test_a_manifest_of_1_0_is_written_again_as_it_was(old: Path) -> None:
    before = (old / "manifest.json").read_bytes()
    write_manifest(read_manifest(old), old)
    assert (old / "manifest.json").read_bytes() == before
    assert "anchors.parquet" not in json.loads(before)["tables"]
