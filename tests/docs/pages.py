# SPDX-License-Identifier: GPL-3.0-or-later
"""The pages that people read, and what a test finds on them: blocks of code, commands in the text, links."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

BESIDE = (
    "README.md",
    "CONTRIBUTING.md",
    "SECURITY.md",
    "blender_addon/README.md",
    "downstream_hpe/models/headturn.md",
)
"""Pages that are not in docs/."""

BLOCK = re.compile(
    r"(?:^<!-- needs: (?P<needs>[^\n]*?) -->\n)?^(?P<indent> *)```(?P<language>\w*)\n(?P<text>.*?)^ *```$",
    re.MULTILINE | re.DOTALL,
)
INLINE = re.compile(r"`((?:headturn|downstream-hpe|make|python)\s[^`]+)`")
LINK = re.compile(r"\]\((?P<target>[^)\s]+)\)")


@dataclass(frozen=True)
class Block:
    """A block of code. needs: what a reader has to have to run it; empty where a test runs it."""

    page: str
    line: int
    language: str
    needs: str
    text: str

    @property
    def place(self) -> str:
        """Where it stands."""
        return f"{self.page}:{self.line}"


def pages() -> list[Path]:
    """Every page, README.md first."""
    return [*(ROOT / name for name in BESIDE), *sorted((ROOT / "docs").rglob("*.md"))]


def read(page: Path) -> str:
    """The text of a page."""
    return page.read_text(encoding="utf-8")


def blocks(*languages: str) -> list[Block]:
    """All blocks of some languages."""
    found = []
    for page in pages():
        text = read(page)
        for match in BLOCK.finditer(text):
            line = text[: match.start("text")].count("\n") + 1
            needs = match["needs"] or ""
            found.append(Block(str(page.relative_to(ROOT)), line, match["language"], needs, match["text"]))
    return [block for block in found if block.language in languages]


def without_blocks(text: str) -> str:
    """The text without code in blocks."""
    return BLOCK.sub("", text)


def inline_commands() -> list[tuple[str, str]]:
    """Commands within sentences: page, and the command in one line."""
    return [
        (str(page.relative_to(ROOT)), " ".join(command.split()))
        for page in pages()
        for command in INLINE.findall(without_blocks(read(page)))
    ]


def lines_of(text: str) -> list[str]:
    """Commands of a block of bash: whole lines, without comments."""
    joined = re.sub(r"\\\n\s*", " ", text)
    return [line.strip() for line in joined.splitlines() if line.strip() and not line.strip().startswith("#")]
