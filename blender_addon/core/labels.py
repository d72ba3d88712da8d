# SPDX-License-Identifier: GPL-3.0-or-later
"""Text on its way to the screen: names and reasons that came out of files, as Blender can show them."""

from __future__ import annotations

import textwrap

from generator.escape import printable


def one_line(text: str) -> str:
    """A text for a label or a report, without control characters and hidden ones."""
    return printable(" ".join(text.split()))


def wrapped(text: str, characters: int) -> list[str]:
    """The lines of at most so many characters that a text fills; Blender's labels do not wrap."""
    return textwrap.wrap(one_line(text), characters) or [""]
