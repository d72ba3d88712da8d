# SPDX-License-Identifier: GPL-3.0-or-later
from __future__ import annotations

import json
from dataclasses import replace

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from generator.dataset.format.heads_table import heads_schema, read_heads, write_heads
from generator.dataset.format.manifest import (
    configuration_digest,
    portable_command,
    read_manifest,
    write_manifest,
)
from generator.dataset.show.card import write_card
from generator.errors import DatasetError


def test_manifest_round_trip_and_totals(dataset):
    manifest = read_manifest(dataset)
    values = json.loads((dataset / "manifest.json").read_text(encoding="utf-8"))
    assert (values["rows"], values["detected_rows"], values["heads"]) == (36, 32, 2)
    assert values["images"] == {"mode": "files", "count": 36}
    assert [part["path"] for part in values["parts"]] == sorted(part["path"] for part in values["parts"])
    assert values["configuration_digest"] == configuration_digest(values["configuration"])
    before = (dataset / "manifest.json").read_bytes()
    write_manifest(replace(manifest, parts=manifest.parts[::-1]), dataset)
    assert (dataset / "manifest.json").read_bytes() == before


def test_same_build_same_bytes(build, tmp_path):
    files = []
    for name in "ab":
        build(tmp_path / name, "embedded")
        every = sorted(p for p in (tmp_path / name).rglob("*") if p.is_file())
        files.append({p.relative_to(tmp_path / name): p.read_bytes() for p in every})
    assert files[0] == files[1]


def test_digest_does_not_depend_on_the_units(build, tmp_path):
    one, two = build(tmp_path / "a", chunk=4), build(tmp_path / "b", chunk=18)
    assert len(one.parts) == 10 and len(two.parts) == 2
    assert one.digest == two.digest


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rows": 35}, "rows contradicts the rest"),
        ({"digest": "0" * 64}, "digest contradicts the rest"),
        ({"configuration": {}}, "configuration_digest contradicts the rest"),
        (
            {"schema_version": "2.0.0"},
            r"schema version '2\.0\.0', expected 1\.x; build it again",
        ),
        ({"schema_version": "0.9.0"}, r"'0\.9\.0', expected 1\.x; build it again from its config\.toml"),
        ({"schema_version": "1.1"}, r"schema version '1\.1', expected 1\.x"),
        ({"schema_version": 1}, r"schema version 1, expected 1\.x"),
        ({"images": {"mode": "sometimes", "count": 0}}, "is none of none, files, embedded"),
        ({"parts": [{}]}, "not a manifest"),
        ({"parts": 3}, "not a manifest"),
        ({"heads": None, "parts": None}, "not a manifest"),
    ],
)
def test_manifest_refuses(dataset, change, message):
    path = dataset / "manifest.json"
    path.write_text(json.dumps({**json.loads(path.read_text(encoding="utf-8")), **change}), encoding="utf-8")
    with pytest.raises(DatasetError, match=message) as error:
        read_manifest(dataset)
    assert "manifest.json" in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize("path", ["../x/part-a.parquet", "/part-a.parquet", "data/../../part-a.parquet"])
def test_manifest_names_nothing_outside_the_dataset(dataset, path):
    file = dataset / "manifest.json"
    values = json.loads(file.read_text(encoding="utf-8"))
    values["parts"][0]["path"] = path
    file.write_text(json.dumps(values), encoding="utf-8")
    with pytest.raises(DatasetError, match="is not where a part can be"):
        read_manifest(dataset)


@pytest.mark.parametrize("content", [b"", b"[]", b"{}", b"null", b"\xff"])
def test_manifest_that_is_none(dataset, content):
    (dataset / "manifest.json").write_bytes(content)
    with pytest.raises(DatasetError, match="not a manifest of Headturn"):
        read_manifest(dataset)


def test_no_manifest_means_not_finished(tmp_path):
    with pytest.raises(DatasetError, match="run `headturn build` again"):
        read_manifest(tmp_path)


def test_a_part_of_a_dataset_and_a_file_are_told_from_no_dataset(dataset):
    with pytest.raises(DatasetError, match=r"data: a part of a dataset; give all of it, .*"):
        read_manifest(dataset / "data")
    with pytest.raises(DatasetError, match=r"README\.md: a file; give the folder"):
        read_manifest(dataset / "README.md")


def test_portable_command():
    arguments = ["headturn", "build", "/home/a b/c.toml", "--out=/data/x", r"C:\heads", "--workers", "2"]
    assert portable_command(arguments) == "headturn build c.toml --out=x heads --workers 2"


def test_heads_round_trip(dataset):
    heads = read_heads(dataset)
    assert heads[1].problems == ("the eyes are closed",) and heads[0].pivot == (0.0, 1.5, -2.25)
    write_heads(heads[::-1], dataset)
    assert read_heads(dataset) == heads
    assert not any(field.nullable for field in heads_schema())


def test_heads_refuse(dataset):
    path = dataset / "heads.parquet"
    table = pq.read_table(path)
    pq.write_table(table.replace_schema_metadata({"headturn.schema_version": "2.1.0"}), path)
    with pytest.raises(DatasetError, match=r"heads\.parquet: schema version '2\.1\.0'"):
        read_heads(dataset)
    pq.write_table(table.drop_columns(["pivot"]), path)
    with pytest.raises(DatasetError, match="not the columns of a table of heads"):
        read_heads(dataset)
    pq.write_table(pa.concat_tables([table, table]), path)
    with pytest.raises(DatasetError, match="a head is there twice"):
        read_heads(dataset)
    path.write_bytes(b"PAR1")
    with pytest.raises(DatasetError, match=r"heads\.parquet: cannot be read"):
        read_heads(dataset)


def test_card_states_licences_and_splits(dataset):
    text = (dataset / "README.md").read_text(encoding="utf-8")
    assert text.startswith("---\nlicense: cc0-1.0\n")
    assert 'path: "data/validation/*.parquet"' in text and "Do not publish" not in text
    assert "| mesh | 2 | CC0-1.0 | yes | A. Person &#124; 2020 |" in text


def test_card_warns_of_heads_that_must_not_be_published(dataset):
    first, second = read_heads(dataset)
    write_heads([first, replace(second, redistributable=False, license="FaceScape")], dataset)
    write_card(read_manifest(dataset), dataset)
    text = (dataset / "README.md").read_text(encoding="utf-8")
    assert "license: other" in text and "**Do not publish this dataset as it is**" in text
