# SPDX-License-Identifier: GPL-3.0-or-later
"""What make installs: locks agree with pyproject.toml and with each other, advisories are looked at."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
import tomllib
from packaging.requirements import Requirement

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "scripts"))

import audit  # noqa: E402
import lock  # noqa: E402

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS = PROJECT["project"]["optional-dependencies"]
LOCKED_EXTRAS = {"build": ["build"], "dev": ["build", "hpe", "cluster", "dev"], "fuzz": ["fuzz"]}
ENVIRONMENT = {"python_version": "3.11", "sys_platform": "linux", "platform_machine": "x86_64", "extra": ""}


def required(name: str) -> list[Requirement]:
    """What a lock is for, as pyproject.toml says it."""
    texts = [text for extra in LOCKED_EXTRAS[name] for text in EXTRAS[extra]]
    texts += [] if name == "fuzz" else [*PROJECT["project"]["dependencies"], *lock.ALONE[name], *lock.TOOLS]
    wanted = map(Requirement, texts)
    return [one for one in wanted if one.marker is None or one.marker.evaluate(ENVIRONMENT)]


@pytest.mark.parametrize("name", LOCKED_EXTRAS)
def test_a_lock_has_what_pyproject_asks_for(name: str) -> None:
    pins = lock.read_lock(lock.lock_file(name))
    for requirement in required(name):
        version, _ = pins[lock.normalised(requirement.name)]
        assert requirement.specifier.contains(version, prereleases=True), requirement


@pytest.mark.parametrize("name", lock.PARTS)
def test_a_lock_is_versions_and_hashes_and_nothing_else(name: str) -> None:
    file = lock.lock_file(name)
    assert lock.read_lock(file), "every line is NAME==VERSION --hash=sha256:DIGITS"
    assert "://" not in file.read_text(encoding="utf-8"), "no registry is named"
    assert lock.lock_text(name, lock.read_lock(file)) == file.read_text(encoding="utf-8")


def test_builds_are_tested_with_the_versions_they_are_made_with() -> None:
    dev, build = (lock.read_lock(lock.lock_file(name)) for name in ("dev", "build"))
    assert not {name for name, pin in build.items() if dev.get(name) != pin}
    assert "torch" not in build, "which anny would bring"


def test_make_installs_from_the_locks_alone() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert "LOCKED = --require-hashes --no-deps --no-build-isolation" in text
    assert set(re.findall(r"requirements/lock-(\w+)\.txt:?", text)) >= set(lock.PARTS)
    for alone in lock.ALONE.values():
        assert f"--no-deps {' '.join(alone)}\n" in text, "where there is no lock, the same version"


@pytest.mark.parametrize(
    "line", ["numpy", "numpy==1", "numpy==1 --hash=md5:0", "--index-url x", "a==1 --hash=sha256:0"]
)
def test_lines_that_pin_nothing_are_refused(line: str, tmp_path: Path) -> None:
    (tmp_path / "lock.txt").write_text(line + "\n")
    with pytest.raises(ValueError, match="is not NAME==VERSION"):
        lock.read_lock(tmp_path / "lock.txt")


# ---- advisories ---------------------------------------------------------


def ended(arguments: list[str], monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(sys, "argv", ["audit.py", *arguments])
    return audit.main()


def test_our_advisories_are_whole_and_nothing_is_held_back_without_a_reason(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    known, as_of = audit.advisories()
    assert len({one.id for one in known}) == len(known)
    assert all(re.fullmatch(r"CVE-\d{4}-\d+", one.id) and one.what and one.here for one in known)
    assert re.fullmatch(r"\d{4}-\d{2}-\d{2}", as_of)
    assert ended([], monkeypatch) == 0
    said = capsys.readouterr().out
    assert "CVE-2025-53644: opencv-contrib-python 4.11" in said and "offline" in said
    page = (ROOT / "docs" / "pins.md").read_text(encoding="utf-8")
    pins = lock.read_lock(lock.lock_file("dev"))
    for one in known:
        assert one.applies(pins) == bool(one.held_back), one.id
        assert not one.held_back or (one.id in page and one.package in page), one.id


def test_an_advisory_that_applies_and_is_not_held_back_fails(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    new = audit.Advisory("CVE-2000-0001", "NumPy", "<2", "it is old", "nothing")
    monkeypatch.setattr(audit, "advisories", lambda: ([new], "2000-01-01"))
    assert ended([], monkeypatch) == 1
    assert "FAIL  CVE-2000-0001: NumPy 1.26.4 (dev, build): it is old" in capsys.readouterr().out


def pip_audit(tmp_path: Path, *rows: dict[str, Any]) -> str:
    """A program that answers as pip-audit does."""
    program = tmp_path / "pip-audit"
    program.write_text(f"#!{sys.executable}\nprint({json.dumps({'dependencies': rows})!r})\n")
    program.chmod(0o755)
    return str(program)


SKIPPED = {"name": "numpy", "skip_reason": "Dependency not found on PyPI and could not be audited"}
FOUND = {
    "name": "numpy",
    "version": "1.26.4",
    "vulns": [{"id": "GHSA-x", "aliases": ["CVE-2000-2"], "fix_versions": ["2"]}],
}
KNOWN = {"name": "pyarrow", "version": "21.0.0", "vulns": [{"id": "PYSEC-1", "aliases": ["CVE-2026-25087"]}]}


@pytest.mark.parametrize(
    ("rows", "code", "words"),
    [
        ([SKIPPED], 0, "not reached (offline)"),  # where pip-audit itself says that all is well
        ([FOUND, SKIPPED], 1, "FAIL  GHSA-x: numpy 1.26.4 (dev), fixed in 2"),
        ([KNOWN], 0, "knew 4 of 4 packages, 0 advisories that ours lacks"),
    ],
)
def test_the_live_list_counts_where_it_answers(
    rows: list[dict], code: int, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:  # fmt: skip
    assert ended(["--pip-audit", pip_audit(tmp_path, *rows)], monkeypatch) == code
    assert words in capsys.readouterr().out


def test_without_pip_audit_it_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert ended(["--pip-audit", str(tmp_path / "none")], monkeypatch) == 0
    assert "not reached (offline)" in capsys.readouterr().out
