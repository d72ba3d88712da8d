# SPDX-License-Identifier: GPL-3.0-or-later
"""Text from files on its way out, a function a door. stdlib only.

A terminal, Markdown, a spreadsheet and a web page each take some characters for orders. Whoever writes to
one of them gives strangers' text through its function, and nothing else is escaped anywhere.
"""

from __future__ import annotations

import json
import re
from typing import Any

_MARKUP = re.compile(r"[&<>|\\`*_\[\]~$]")
# Spreadsheets take these, also after a separator of another country's lists, for the start of a formula.
_FORMULA = re.compile(r"(^|[;,\t])('*\s*[=+\-@＝＋－＠])")


def printable(text: str) -> str:
    """For a terminal, a log or a label: on one line, control characters and hidden ones escaped."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def shortened(text: str, most: int = 80) -> str:
    """A stranger's text on one line of at most so many characters."""
    return printable(text if len(text) <= most else text[: most - 3] + "...")


def quoted(text: str) -> str:
    """A stranger's name in quotes, for a message."""
    return f"'{shortened(text)}'"


def markdown(text: str) -> str:
    """For a line or a cell of Markdown: shown as it is, whatever it would mean there or in HTML."""
    return _MARKUP.sub(lambda found: f"&#{ord(found[0])};", printable(" ".join(text.split())))


def markdown_code(text: str) -> str:
    """As :func:`markdown`, set as code; backticks and bars would end a code span of Markdown's own."""
    return f"<code>{markdown(text)}</code>"


def csv_text(text: str) -> str:
    """For a cell of CSV: where a spreadsheet would see a formula, ' stands before it."""
    return _FORMULA.sub(r"\1'\2", printable(text))


def html_json(data: Any) -> str:
    """JSON for an element of a web page, which nothing in it can end. ValueError: a number is not finite."""
    text = json.dumps(_shown(data), ensure_ascii=False, separators=(",", ":"), allow_nan=False)
    return text.replace("&", "\\u0026").replace("<", "\\u003c").replace(">", "\\u003e")


def _shown(value: Any) -> Any:
    """Plain values whose texts are printable."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, dict):
        return {_shown(key): _shown(inner) for key, inner in value.items()}
    return [_shown(inner) for inner in value] if isinstance(value, (list, tuple)) else value
