# SPDX-License-Identifier: MIT
"""Modules do not come from the folder one happens to be in: a ``numpy.py`` beside somebody's data would run.

This module imports what Python has loaded before it runs anything, not even ``__future__``: for whoever typed
``python -m downstream_hpe.cli`` a file of that name still counts.
"""

import os
import sys


def forget_current_folder() -> None:
    """No module of the current folder from here on, in this process and in those that libraries start.

    ``python -m`` puts it first, and an entry of PYTHONPATH that is no full path means it. Full paths there
    are the user's choice.
    """
    given = os.environ.pop("PYTHONPATH", "")
    entries = given.split(os.pathsep) if given else []
    full = [entry for entry in entries if os.path.isabs(entry)]
    os.environ["PYTHONSAFEPATH"] = "1"
    if full:
        os.environ["PYTHONPATH"] = os.pathsep.join(full)
    try:
        here = os.getcwd()
    except OSError:  # it was deleted: nothing can come from there
        return
    options = sys.orig_argv[: len(sys.orig_argv) - len(sys.argv) + 1]
    if sys.path[:1] == [here] and "-m" in options:
        del sys.path[0]  # what stands there for other reasons comes again
    # By now an entry that is no full path has been made one.
    others = set(map(os.path.abspath, entries)) - set(map(os.path.abspath, full))
    sys.path[:] = [entry for entry in sys.path if entry and entry not in others]
