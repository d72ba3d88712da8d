# SPDX-License-Identifier: GPL-3.0-or-later
"""Docstrings as the site shows them (mkdocs.yml): our few habits, as Markdown.

range_deg: float [3, 2], the angles ...      becomes a line of a list
>>> predictor = Predictor()                  becomes code
"""

from __future__ import annotations

import re
from typing import Any

import griffe

NAMED = re.compile(r"^(?P<names>\w+(?:, \w+)*|\w+ \.\.\. \w+): ")
"""How a line begins that says what an argument or an attribute is."""

SAID = ("Raises", "Returns", "Example", "Examples", "Note")


class AsMarkdown(griffe.Extension):
    """It is called once for every object that is read."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Write the docstring of an object anew."""
        if obj.docstring is not None:
            obj.docstring.value = as_markdown(obj.docstring.value)


def as_markdown(text: str) -> str:
    """A docstring with lists and code; sections underlined with dashes stay for griffe."""
    if re.search(r"^-{4,}$", text, re.MULTILINE):
        return text
    lines: list[str] = []
    for line in text.splitlines():
        found = NAMED.match(line)
        if found and found["names"] not in SAID:
            if lines and lines[-1] and not lines[-1].startswith(("- ", "    ")):
                lines.append("")
            lines.append(f"- `{found['names']}`: {line[found.end() :]}")
        elif line.startswith((">>> ", "... ")):
            if not (lines and lines[-1].startswith("    ")):
                lines.append("")
            lines.append(f"    {line}")
        else:
            lines.append(line)
    return "\n".join(lines)
