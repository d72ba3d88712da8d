# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``headturn`` command: what people type, and what they see."""


def main() -> None:
    """Entry point of the console script and of ``python -m generator.cli``."""
    # Before any other import, even of __future__: see there.
    from generator.interpreter import forget_current_folder

    forget_current_folder()
    from generator.cli.app import main

    main()
