# SPDX-License-Identifier: GPL-3.0-or-later
"""The ``headturn`` command: what people type, and what they see."""

import os
import sys


def main() -> None:
    """Entry point of the console script and of ``python -m generator.cli``."""
    # Before any other import, even of __future__: see there.
    from generator.interpreter import forget_current_folder

    environment, path = os.environ.copy(), sys.path[:]
    try:
        forget_current_folder()
        _run()
    finally:  # of a program that calls this and goes on
        os.environ.clear()
        os.environ.update(environment)
        sys.path[:] = path


def _run() -> None:
    from generator.execution.stopping import Stopped, stoppable

    try:
        with stoppable():
            from generator.cli.app import main

            main()
    except Stopped as stopped:
        # Without rich, whose import may be what was stopped.
        further = "; run the same command again to continue" if sys.argv[1:2] == ["build"] else ""
        sys.stderr.write(f"headturn: {stopped}{further}\n")
        sys.exit(stopped.exit_code)
    except ImportError as error:
        from litert_faces.installing import numpy_clash

        if (line := numpy_clash(error)) is None:
            raise
        sys.stderr.write(f"headturn: {line}\n")
        sys.exit(1)
