# SPDX-License-Identifier: GPL-3.0-or-later
"""Text from files on its way out, a function a door. stdlib only."""

from __future__ import annotations


def printable(text: str) -> str:
    """A stranger's text on one line: what no terminal should get is escaped."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def shortened(text: str, most: int = 80) -> str:
    """A stranger's text on one line of at most so many characters."""
    return printable(text if len(text) <= most else text[: most - 3] + "...")


def quoted(text: str) -> str:
    """A stranger's name in quotes, for a message."""
    return f"'{shortened(text)}'"
