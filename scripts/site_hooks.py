# SPDX-License-Identifier: GPL-3.0-or-later
"""What mkdocs asks while it builds the site (mkdocs.yml): pages from beside docs/, and links that leave it.

The pages of docs/ link files of the repository, as they are read there. On the site some of these files are
pages, and the others are names: the site is one folder, and knows no address of a repository.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[1]

PAGES = {
    "SECURITY.md": "security.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changes.md",
    "downstream_hpe/models/headturn.md": "model-card.md",
}
"""File of the repository -> its page on the site."""

LINK = re.compile(r"(?<!!)\[(?P<text>[^\]]+)\]\((?P<target>[^)\s]+)\)")
FENCED = re.compile(r"(^ *```.*?^ *```$)", re.MULTILINE | re.DOTALL)


def on_config(config: Any) -> Any:
    """List the records below the page of decisions."""
    records = sorted(path.name for path in (ROOT / "docs" / "decisions").glob("*.md"))
    [project] = [entry["Project"] for entry in config.nav if "Project" in entry]
    [decisions] = [entry for entry in project if "Decisions" in entry]
    decisions["Decisions"] = ["decisions.md", *(f"decisions/{name}" for name in records)]
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that lie beside docs/."""
    for source, page in PAGES.items():
        files.append(File.generated(config, page, content=(ROOT / source).read_text(encoding="utf-8")))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """The text of a page with its links as the site has them."""
    homes = {page: source for source, page in PAGES.items()}
    source = homes.get(page.file.src_uri, f"docs/{page.file.src_uri}")
    parts = FENCED.split(markdown)
    parts[::2] = [
        LINK.sub(lambda found: _link(found, source, page.file.src_uri), text) for text in parts[::2]
    ]
    return "".join(parts)


def _link(found: re.Match[str], source: str, page: str) -> str:
    text, target = found["text"], found["target"]
    path, mark, anchor = target.partition("#")
    if not path or "://" in path or path.startswith("mailto:"):
        return found[0]
    named = posixpath.normpath(posixpath.join(posixpath.dirname(source), path))
    if not (ROOT / named).exists():
        return found[0]  # mkdocs says that it is missing
    if named.startswith("docs/"):
        on_site = named.removeprefix("docs/")
    elif named in PAGES:
        on_site = PAGES[named]
    else:
        return text if named in text or "`" in text else f"{text} (`{named}`)"
    return f"[{text}]({posixpath.relpath(on_site, posixpath.dirname(page) or '.')}{mark}{anchor})"
