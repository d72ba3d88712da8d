# SPDX-License-Identifier: GPL-3.0-or-later
"""What the fixture ``command`` gives."""

from __future__ import annotations

from collections.abc import Callable

Command = Callable[..., tuple[int, str]]
"""Takes the words of a command; its exit code, and what it said on stderr."""
