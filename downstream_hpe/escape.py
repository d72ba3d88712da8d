# SPDX-License-Identifier: MIT
"""Text from files on its way out, a function a door: names of files and subjects are other people's."""

from __future__ import annotations

import re

_MARKUP = re.compile(r"[&<>|\\`*_\[\]~$]")
# Spreadsheets take these, also after a separator of another country's lists, for the start of a formula.
_FORMULA = re.compile(r"(^|[;,\t])(\s*[=+\-@＝＋－＠])")


def printable(text: str) -> str:
    """For a terminal or a picture: on one line, control characters and hidden ones escaped."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def markdown(text: str) -> str:
    """For a line or a cell of Markdown: shown as it is, whatever it would mean there or in HTML."""
    return _MARKUP.sub(lambda found: f"&#{ord(found[0])};", printable(" ".join(text.split())))


def csv_text(text: str) -> str:
    """For a cell of CSV: where a spreadsheet would see a formula, ' stands before it."""
    return _FORMULA.sub(r"\1'\2", printable(text))
