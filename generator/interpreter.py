# SPDX-License-Identifier: GPL-3.0-or-later
"""Python processes that import nothing from the folder one happens to be in: how each is started.

``python -m`` and ``python -c`` look for modules in the current folder first, and so does an empty entry of
PYTHONPATH: a ``numpy.py`` beside somebody's data would run. Python 3.11 can be told not to, 3.10 cannot;
what is done here works with both. Whatever starts a Python takes its command and its environment from here.

This module imports what Python has loaded before it runs anything, not even ``__future__``: for whoever typed
``python -m generator.cli`` a file of that name still counts.
"""

import os
import sys

_START = (
    "import sys; sys.path[:] = filter(None, sys.path); home, *sys.argv = sys.argv[1:]; "
    "home in ('', *sys.path) or sys.path.insert(0, home); "
    "from runpy import run_module; run_module(sys.argv[0], None, '__main__', True)"
)


def python_command(module: str, *arguments: str) -> list[str]:
    """How this Python runs a module of this package, the very one that runs here.

    To be started with :func:`python_environment`.
    """
    home = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    return [sys.executable, "-c", _START, home, module, *arguments]


def other_python_command(python: str, module: str) -> list[str]:
    """How another Python runs a module that is installed there; arguments may follow."""
    return [python, "-c", _START, "", module]


def python_environment() -> dict[str, str]:
    """Our environment, but no Python in it, however deep, looks for modules in its current folder.

    Entries of PYTHONPATH that are no full paths mean that folder and go; the others are the user's choice.
    """
    clean = {**os.environ, "PYTHONSAFEPATH": "1"}
    kept = list(filter(os.path.isabs, clean.pop("PYTHONPATH", "").split(os.pathsep)))
    if kept:
        clean["PYTHONPATH"] = os.pathsep.join(kept)
    return clean


def guard_environment() -> None:
    """:func:`python_environment` from here on, for what others start."""
    environment = python_environment()
    if "PYTHONPATH" not in environment:
        os.environ.pop("PYTHONPATH", None)
    os.environ.update(environment)


def forget_current_folder() -> None:
    """No module of the current folder from here on, in this process and in those it starts.

    For commands, as the first thing they do; a program that uses the package has a path of its own.
    """
    given = os.environ.get("PYTHONPATH")
    entries = given.split(os.pathsep) if given else []
    guard_environment()
    try:
        here = os.getcwd()
    except OSError:  # it was deleted: nothing can come from there
        return
    # Python puts it first for -m. What stands there for other reasons comes again, as in an own checkout.
    options = sys.orig_argv[: len(sys.orig_argv) - len(sys.argv) + 1]
    if sys.path[:1] == [here] and "-m" in options:
        del sys.path[0]
    # By now an entry that is no full path has been made one.
    full = set(map(os.path.abspath, filter(os.path.isabs, entries)))
    others = set(map(os.path.abspath, entries)) - full
    sys.path[:] = [entry for entry in sys.path if entry and entry not in others]
