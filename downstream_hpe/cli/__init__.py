# SPDX-License-Identifier: MIT
"""The ``downstream-hpe`` command: what people type, and what they see."""

import os
import sys


def main() -> None:
    """Entry point of the console script and of ``python -m downstream_hpe.cli``."""
    # Before any other import: the current folder must not be where modules come from.
    from downstream_hpe.cli.current_folder import forget_current_folder

    environment, path = os.environ.copy(), sys.path[:]
    try:
        forget_current_folder()
        _run()
    finally:  # of a program that calls this and goes on
        os.environ.clear()
        os.environ.update(environment)
        sys.path[:] = path


def _run() -> None:
    for stream in (sys.stdout, sys.stderr):
        # A path may hold what this terminal, or any, cannot show.
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")
    from downstream_hpe.cli.app import main

    main()
