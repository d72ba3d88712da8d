# SPDX-License-Identifier: GPL-3.0-or-later
"""The site is built without a warning, opens from a file, and asks for nothing from anywhere."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pages
import pytest

sys.path.append(str(pages.ROOT / "tests" / "downstream_hpe"))

from browser import Browser

pytestmark = pytest.mark.slow


def build(source: Path, target: Path) -> subprocess.CompletedProcess[str]:
    """What make docs does."""
    mkdocs = Path(sys.prefix, "docs", "bin", "mkdocs")
    if not mkdocs.exists():
        pytest.skip(f"no {mkdocs}; `make docs` installs it")
    command = [str(mkdocs), "build", "--strict", "--site-dir", str(target)]
    return subprocess.run(
        command, cwd=source, capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    )


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site."""
    folder = tmp_path_factory.mktemp("site") / "site"
    done = build(pages.ROOT, folder)
    assert done.returncode == 0, done.stderr
    # Nor a remark: each says what the next person has to look up, and hides a warning that is new.
    remarks = [line for line in done.stderr.splitlines() if not re.search("Cleaning|Building|built in", line)]
    assert not remarks, "renew the environment with `make docs`"
    return folder


def test_every_page_is_there_and_code_is_described(site: Path) -> None:
    for page in (pages.ROOT / "docs").rglob("*.md"):
        assert (site / page.relative_to(pages.ROOT / "docs")).with_suffix(".html").is_file(), page
    for page in ("security", "contributing", "changes", "model-card"):
        assert (site / f"{page}.html").is_file()
    python = (site / "python.html").read_text(encoding="utf-8")
    assert "Pose of the most prominent faces of a picture" in python
    assert "headturn heads make" in (site / "commands.html").read_text(encoding="utf-8")


def test_pages_load_nothing_from_elsewhere(site: Path) -> None:
    loads = re.compile(r"<(?:script|link|img|iframe)\b[^>]*?(?:src|href)=[\"']?(?:https?:)?//[^\"'> ]+")
    found = {hit for page in site.rglob("*.html") for hit in loads.findall(page.read_text(encoding="utf-8"))}
    assert not found


def test_a_warning_is_an_error(site: Path, tmp_path: Path) -> None:
    """A link that leads nowhere, under the very rules of the site."""
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs" / "index.md").write_text("# Page\n\n[gone](gone.md)\n", encoding="utf-8")
    rules = {
        "INHERIT": str(pages.ROOT / "mkdocs.yml"),
        "docs_dir": "docs",
        "nav": ["index.md"],
        "plugins": [],
    }
    (tmp_path / "mkdocs.yml").write_text(json.dumps({**rules, "hooks": []}), encoding="utf-8")
    done = build(tmp_path, tmp_path / "site")
    assert done.returncode != 0 and "'gone.md', but the target is not found" in done.stderr


def test_it_opens_from_a_file_and_searches(site: Path, tmp_path: Path) -> None:
    query = "document.querySelector('[data-md-component=search-query]')"
    with Browser(tmp_path) as browser:
        for width in (1280, 390):
            browser.open((site / "configuration.html").as_uri(), width)
            browser.wait("document.readyState == 'complete'")
            assert browser.run("document.documentElement.scrollWidth") <= width, (
                "nothing is wider than the page"
            )
        browser.open((site / "index.html").as_uri())
        browser.wait("document.readyState == 'complete'")
        browser.run(f"{query}.focus()")
        browser.run(f"{query}.value = 'quarantined'")
        browser.run(f"{query}.dispatchEvent(new KeyboardEvent('keyup', {{bubbles: true}}))")
        assert browser.wait("document.querySelectorAll('.md-search-result__item').length")
        assert "Glossary" in browser.run("document.querySelector('.md-search-result__list').innerText")
        assert not [
            address for address in browser.requests if not address.startswith(("file:", "data:", "blob:"))
        ]
        assert not browser.console
