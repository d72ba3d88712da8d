# SPDX-License-Identifier: MIT
"""The ``downstream-hpe`` command: what people type, and what they see."""

from __future__ import annotations


def main() -> None:
    """Entry point of the console script and of ``python -m downstream_hpe.cli``."""
    from downstream_hpe.cli.app import main

    main()
