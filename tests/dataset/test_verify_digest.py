# SPDX-License-Identifier: GPL-3.0-or-later
"""The digest and the root that verify prints and compares."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from damage import failures, rewrite
from test_compact import Quiet
from typer.testing import CliRunner

from generator.cli.app import app
from generator.dataset.format.compact import compact_dataset
from generator.dataset.format.digest import row_hashes
from generator.dataset.format.manifest import read_manifest
from generator.dataset.format.merkle import merkle_root
from generator.dataset.format.part import read_part
from generator.dataset.proof.verify import verify_dataset
from generator.errors import UsageError


def ask(*arguments: str | Path) -> tuple[int, str]:
    """Exit code and what was printed. Raises what the command raises."""
    answer = CliRunner().invoke(app, ["verify", *map(str, arguments)], catch_exceptions=True)
    if answer.exception is not None and not isinstance(answer.exception, SystemExit):
        raise answer.exception
    return answer.exit_code, answer.stdout


def test_the_last_line_has_digest_and_root(dataset: Path) -> None:
    code, said = ask(dataset)
    manifest = read_manifest(dataset)
    root = merkle_root([row_hashes(read_part(dataset / part.path)) for part in manifest.parts])
    assert code == 0
    assert said.splitlines()[-1] == f"digest {manifest.digest}, Merkle root {root}"
    facts = json.loads(ask(dataset, "--json")[1])
    assert (facts["digest"], facts["merkle_root"]) == (manifest.digest, root)
    code, said = ask(dataset, "--quick")
    assert said.splitlines()[-1] == f"digest {manifest.digest}, as the manifest says"


def test_what_is_proved_and_what_not_is_said(dataset: Path) -> None:
    said = ask(dataset)[1]
    assert "\nproved: every row of the plan is there once" in said
    assert "\nnot proved: that images show what was recorded (--deep" in said
    assert "\nnot proved: that nobody recorded it all anew" in said
    assert "does not prove that images show" in CliRunner().invoke(app, ["verify", "--help"]).stdout
    (dataset / "poses.csv").write_text("nothing")
    assert "proved: " not in ask(dataset)[1]


def test_an_expected_digest(dataset: Path) -> None:
    report = verify_dataset(dataset)
    for right in (report.digest, report.merkle_root, report.merkle_root.upper()):
        code, said = ask(dataset, "--digest", right)
        assert code == 0 and "ok    expected digest" in said
        assert ("is a checksum" in said) == (right == report.digest)
        assert ("recorded it all anew" in said) == (right == report.digest)
    code, said = ask(dataset, "--digest", "0" * 64)
    assert code == 1
    assert f"FAIL  expected digest: neither digest nor Merkle root of the rows is {'0' * 64}" in said


def test_a_dataset_made_anew_has_neither(dataset: Path) -> None:
    """Everything in it agrees, the manifest too; only who knows the root from elsewhere sees it."""
    before = verify_dataset(dataset)
    detected = read_part(dataset / "data/train/part-s1-0.parquet")["landmarks"].to_pylist()
    detected[0] = [value + 1 for value in detected[0]]
    rewrite(dataset, {"landmarks": detected}, honest=True)
    assert verify_dataset(dataset).ok
    for known in (before.digest, before.merkle_root):
        assert set(failures(verify_dataset(dataset, expected=known))) == {"expected digest"}


def test_the_root_does_not_depend_on_files(dataset: Path, tmp_path: Path) -> None:
    before = verify_dataset(dataset)
    compact_dataset(dataset, tmp_path / "merged", reporter=Quiet())
    after = verify_dataset(tmp_path / "merged", expected=before.merkle_root)
    assert after.ok, after.text()
    assert (after.digest, after.merkle_root) == (before.digest, before.merkle_root)


def test_nothing_is_expected_of_what_cannot_be_read(dataset: Path) -> None:
    (dataset / "heads.parquet").unlink()
    report = verify_dataset(dataset, expected="0" * 64)
    assert "not checked" in failures(report)["expected digest"] and not report.ok


def test_a_digest_that_is_none_and_one_with_quick_are_refused(dataset: Path) -> None:
    with pytest.raises(UsageError, match="--digest 'abc': expected 64 hexadecimal digits"):
        ask(dataset, "--digest", "abc")
    with pytest.raises(UsageError, match="leave --quick out"):
        ask(dataset, "--digest", "0" * 64, "--quick")
