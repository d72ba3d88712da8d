# SPDX-License-Identifier: GPL-3.0-or-later
"""Links lead somewhere, every page of docs/ is on the site, decisions say what was rejected."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pages
import pytest

sys.path.append(str(pages.ROOT / "scripts"))

import make_docs
import make_pictures


def anchors(text: str) -> set[str]:
    """What # may name on a page, as GitHub makes it of the headings."""
    titles = re.findall(r"^#+ +(.*)$", pages.without_blocks(text), re.MULTILINE)
    plain = [re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", title).lower() for title in titles]
    return {re.sub(r"[^\w\- ]", "", title).strip().replace(" ", "-") for title in plain}


@pytest.mark.parametrize("page", pages.pages(), ids=lambda page: str(page.relative_to(pages.ROOT)))
def test_links(page: Path) -> None:
    wrong = []
    for target in pages.LINK.findall(pages.without_blocks(pages.read(page))):
        address = urlsplit(target)
        if address.scheme:
            if address.scheme != "https" or not address.hostname:
                wrong.append(f"{target}: no address")
            continue
        file = page.parent / address.path if address.path else page
        if not file.exists():
            wrong.append(f"{target}: there is no such file")
        elif address.fragment and address.fragment not in anchors(pages.read(file)):
            wrong.append(f"{target}: there is no such heading")
    assert not wrong


def test_pictures_are_all_shown() -> None:
    shown = {Path(target).name for page in pages.pages() for target in pages.LINK.findall(pages.read(page))}
    there = {path.name for path in (pages.ROOT / "docs" / "images").iterdir()}
    assert not there - shown


def test_a_command_makes_every_picture() -> None:
    made, elsewhere = set(make_pictures.PICTURES), set(make_pictures.ELSEWHERE)
    assert made | elsewhere == {path.name for path in (pages.ROOT / "docs" / "images").iterdir()}
    assert not made & elsewhere


def test_the_readme_fits_on_two_screens() -> None:
    assert len(pages.read(pages.ROOT / "README.md").splitlines()) <= 110


def test_decisions_are_dated_and_say_what_was_rejected(tmp_path: Path) -> None:
    records = sorted((pages.ROOT / "docs" / "decisions").glob("*.md"))
    numbers = [record.name[:4] for record in records]
    assert numbers == [f"{k:04}" for k in range(1, len(records) + 1)], "a number is missing, or there twice"
    (tmp_path / "0001-a.md").write_text("# A\n\n*2026-11-27*\n\nSince.\n", encoding="utf-8")
    with pytest.raises(ValueError, match=r"0001-a.md: expected .*Rejected"):
        make_docs.decisions(tmp_path)
