# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``headturn`` command: what people type, and what they see."""

from __future__ import annotations


def main() -> None:
    """Entry point of the console script and of ``python -m generator.cli``."""
    from generator.cli.app import main

    main()
