# SPDX-License-Identifier: GPL-3.0-or-later
"""The lists that say how this repository is worked on name what is there: tiers, mutants, releases, CI."""

from __future__ import annotations

import csv
import re
import subprocess
import sys
from pathlib import Path

import pytest
import tomllib

import generator

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "scripts"))

import outdated  # noqa: E402

MUTANTS = ROOT / "tests" / "mutants"
PARTS = tomllib.loads((MUTANTS / "parts.toml").read_text(encoding="utf-8"))


def test_longer_modules_are_there_and_none_is_slow_throughout() -> None:
    lines = (ROOT / "tests" / "longer.txt").read_text(encoding="utf-8").splitlines()
    modules = [line for line in lines if not line.startswith("#")]
    assert modules == sorted(set(modules))
    for module in modules:
        assert "\npytestmark = pytest.mark.slow" not in (ROOT / module).read_text(encoding="utf-8"), module


def test_parts_of_mutants_have_sources_and_tests() -> None:
    for name, part in PARTS.items():
        assert all(list(ROOT.glob(pattern)) for pattern in part["sources"]), name
        assert all((ROOT / test).exists() for test in part["tests"]), name


def test_survivors_are_of_lines_that_still_stand_there() -> None:
    known = tomllib.loads((MUTANTS / "survivors.toml").read_text(encoding="utf-8"))["survivor"]
    tried = {file for part in PARTS.values() for pattern in part["sources"] for file in ROOT.glob(pattern)}
    for one in known:
        assert ROOT / one["file"] in tried, one
        lines = (ROOT / one["file"]).read_text(encoding="utf-8").splitlines()
        assert one["was"] in map(str.strip, lines), one
        assert one["why"].strip() and one["becomes"] != one["was"]
    assert len({(one["file"], one["was"], one["becomes"]) for one in known}) == len(known)


# ---- what is locked, and what is newest ---------------------------------


def test_what_is_held_back_is_what_the_page_says() -> None:
    held = outdated.held_back()
    assert {"numpy", "pyarrow", "mediapipe", "bpy", "jaxlib"} <= held
    assert not held & {"scipy", "pillow", "typer"}


def test_newer_releases_are_listed_and_a_silent_registry_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    said = {"pyarrow": "pyarrow (99.0)\nAvailable versions: 99.0", "rich": "rich (98.5)\n"}

    def run(command: list[str], **options: object) -> subprocess.CompletedProcess[str]:
        return subprocess.CompletedProcess(command, 0, said.get(command[-1], f"{command[-1]} (0.0)"), "")

    monkeypatch.setattr(outdated.subprocess, "run", run)
    monkeypatch.setattr(sys, "argv", ["outdated.py", "build", "dev"])
    assert outdated.main() == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[:-1]] == ["pyarrow", "rich"]
    assert "21.0.0" in lines[0] and lines[0].endswith("held back: docs/pins.md")
    assert lines[-1].startswith("2 have newer releases, 1 are held back")
    said |= {"rich": ""}
    assert outdated.main() == 1
    assert capsys.readouterr().err.startswith("outdated.py: pip knows nothing of rich")
    monkeypatch.setattr(sys, "argv", ["outdated.py", "none"])
    with pytest.raises(SystemExit, match="no lock none; expected dev"):
        outdated.main()


# ---- whoever hosts it ---------------------------------------------------


def test_the_workflow_does_what_ci_does_and_issues_ask_for_doctor() -> None:
    yaml = pytest.importorskip("yaml")
    jobs = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text(encoding="utf-8"))["jobs"]
    assert {"run": ".ci/run", "shell": "bash"} in jobs["everything"]["steps"]
    pythons = {one["python"] for one in jobs["parts"]["strategy"]["matrix"]["include"]}
    assert pythons == {"3.10", "3.12", "3.13", "3.14"}
    for folder in re.findall(r"\btests/\S+", str(jobs["parts"]["steps"])):
        assert (ROOT / folder.strip("'\"]},")).exists(), folder
    fault = yaml.safe_load((ROOT / ".github/ISSUE_TEMPLATE/fault.yml").read_text(encoding="utf-8"))
    asked = {one["id"]: one for one in fault["body"]}
    for command in ("headturn doctor", "downstream-hpe doctor"):
        assert command in asked["doctor"]["attributes"]["description"]
    assert asked["doctor"]["validations"]["required"]
    hooks = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text(encoding="utf-8"))["repos"][0][
        "hooks"
    ]
    assert [hook["id"] for hook in hooks] == [
        "ruff",
        "ruff-format",
        "mypy",
        "workflows",
        "issue-forms",
        "quick",
    ]


def test_the_changelog_has_versions_with_dates_and_a_line_a_change() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    headings = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert headings[0] == "Unreleased"
    assert all(re.fullmatch(r"\d+\.\d+\.\d+, \d{4}-\d{2}-\d{2}", one) for one in headings[1:])
    assert any(one.startswith(f"{generator.__version__},") for one in headings) or len(headings) == 1


def test_every_commands_of_make_is_explained() -> None:
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    for target in ("quick", "most", "coverage", "mutants", "outdated", "dist", "audit", "lock"):
        assert re.search(rf"^#   make {target} ", text, re.MULTILINE), target
        assert re.search(rf"^\.PHONY:.*\b{target}\b", text, re.MULTILINE), target


def test_history_has_a_line_a_figure() -> None:
    with (ROOT / "benchmarks" / "history.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    keys = [(row["version"], row["commit"], row["machine"], row["figure"]) for row in rows]
    assert len(set(keys)) == len(keys)
    for row in rows:
        assert float(row["value"]) > 0 and (row["ratio"] == "" or float(row["ratio"]) > 0)
