# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn upgrade``."""

import typer


def register(app: typer.Typer) -> None:
    """Nothing yet."""
