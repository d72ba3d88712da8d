# SPDX-License-Identifier: GPL-3.0-or-later
"""make release: the changelog's heading, the version and the tag are one step, or nothing is changed."""

from __future__ import annotations

import datetime
import os
import re
import sys
from pathlib import Path

import pytest
from packaging.version import Version

import generator

ROOT = Path(__file__).resolve().parents[1]
sys.path.append(str(ROOT / "scripts"))

from release import RELEASED, UNRELEASED, ReleaseError, git, release  # noqa: E402

DAY = datetime.date(2031, 2, 3)
NEW = "### Faster\n\n- A change.\n\n"
CHANGES = f"# Changes\n\n{UNRELEASED}\n\n{NEW}## 0.1.0, 2030-01-01\n\n### First\n\n- All.\n"


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A repository with a release and something unreleased."""
    for name in [name for name in os.environ if name.startswith("GIT_")]:
        monkeypatch.delenv(name)
    for role in ("AUTHOR", "COMMITTER"):
        monkeypatch.setenv(f"GIT_{role}_NAME", "A")
        monkeypatch.setenv(f"GIT_{role}_EMAIL", "a@example.org")
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    (tmp_path / "generator").mkdir()
    (tmp_path / "generator" / "__init__.py").write_text('"""Doc."""\n\n__version__ = "0.1.0"\n')
    (tmp_path / "CHANGELOG.md").write_text(CHANGES)
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "--quiet", "--message", "First")
    return tmp_path


def test_a_release_is_a_heading_a_version_and_a_tag(checkout: Path) -> None:
    assert release("0.2.0", checkout, day=DAY) == "v0.2.0"
    text = (checkout / "CHANGELOG.md").read_text()
    assert text == CHANGES.replace(UNRELEASED, f"{UNRELEASED}\n\n## 0.2.0, 2031-02-03")
    assert '__version__ = "0.2.0"' in (checkout / "generator" / "__init__.py").read_text()
    assert not git(checkout, "status", "--porcelain")
    assert git(checkout, "describe").strip() == "v0.2.0"
    assert git(checkout, "tag", "--list", "--format=%(contents)") == "Headturn 0.2.0\n\n- Faster\n\n"


@pytest.mark.parametrize(
    ("version", "spoil", "says"),
    [
        ("0.1.0", "", "no version X.Y.Z above 0.1.0"),
        ("0.2", "", "no version X.Y.Z"),
        ("v0.2.0", "", "no version X.Y.Z"),
        ("0.2.0", "nothing new", "nothing to release"),
        ("0.2.0", "not committed", "files are not committed"),
        ("0.2.0", "tagged", "v0.2.0 is there already"),
    ],
)
def test_what_is_no_release_changes_nothing(checkout: Path, version: str, spoil: str, says: str) -> None:
    if spoil == "nothing new":
        (checkout / "CHANGELOG.md").write_text(CHANGES.replace(NEW, ""))
        git(checkout, "commit", "--quiet", "--all", "--message", "Nothing")
    elif spoil == "not committed":
        (checkout / "new").touch()
    elif spoil == "tagged":
        git(checkout, "tag", "v0.2.0")
    before = git(checkout, "rev-parse", "HEAD"), git(checkout, "status", "--porcelain")
    with pytest.raises(ReleaseError, match=re.escape(says)):
        release(version, checkout, day=DAY)
    assert before == (git(checkout, "rev-parse", "HEAD"), git(checkout, "status", "--porcelain"))
    assert '__version__ = "0.1.0"' in (checkout / "generator" / "__init__.py").read_text()


def test_the_changelog_has_this_version_with_its_date_newest_first() -> None:
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    versions = [Version(version) for version, _ in RELEASED.findall(text)]
    assert versions == sorted(versions, reverse=True) and text.count(UNRELEASED) == 1
    assert versions[:1] in ([], [Version(generator.__version__)])  # none before the first release
    days = [datetime.date.fromisoformat(day) for _, day in RELEASED.findall(text)]
    assert days == sorted(days, reverse=True)
