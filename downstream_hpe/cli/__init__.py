# SPDX-License-Identifier: MIT
"""The ``downstream-hpe`` command: what people type, and what they see."""


def main() -> None:
    """Entry point of the console script and of ``python -m downstream_hpe.cli``."""
    # Before any other import: the current folder must not be where modules come from.
    from downstream_hpe.cli.current_folder import forget_current_folder

    forget_current_folder()
    from downstream_hpe.cli.app import main

    main()
