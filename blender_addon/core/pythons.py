# SPDX-License-Identifier: GPL-3.0-or-later
"""Pythons of this machine that an environment for the host can be made of."""

from __future__ import annotations

import glob
import os
import shutil
import subprocess
from collections.abc import Callable, Iterator, Mapping

from generator.errors import UsageError
from generator.platforms import HERE, Platform
from generator.reading import parse_json

VERSIONS = ((3, 11), (3, 12), (3, 10))
"""For which every library of a build exists, the best first: bpy, which gives the bytes of the command line,
exists for 3.11 alone. With the others this Blender renders."""

Version = tuple[int, int]
_ASK = "import ensurepip, venv, sys; print(list(sys.version_info[:2]))"
_TIMEOUT_S = 20


class NoPython(UsageError):
    """There is no Python that will do. commands: each would install one."""

    def __init__(self, platform: Platform) -> None:
        self.commands = platform.install_python
        super().__init__(
            "no Python 3.11 (nor 3.12 or 3.10) that can make environments was found on this machine: "
            "install one, for example so, and press Set Up again"
        )


def find_python(own: str, environ: Mapping[str, str] = os.environ, platform: Platform = HERE) -> str:
    """The best Python of this machine. own: Blender's, "" if it has none. Raises NoPython.

    On PATH and in the usual places, of pyenv, of uv, of the py launcher, Blender's own.
    """
    best: tuple[int, str] | None = None
    for path in dict.fromkeys(candidates(own, environ, platform)):
        version = asked(path)
        if version in VERSIONS and (best is None or VERSIONS.index(version) < best[0]):
            best = VERSIONS.index(version), path
            if best[0] == 0:
                break
    if best is None:
        raise NoPython(platform)
    return best[1]


def candidates(own: str, environ: Mapping[str, str], platform: Platform) -> Iterator[str]:
    """Paths of what may be a Python; those that say they are the best first."""
    path = platform.search_path(environ)
    names = [f"python{major}.{minor}" for major, minor in VERSIONS]
    for name in (*names, "python3", "python"):
        if found := shutil.which(name, path=path):
            yield found
    home = environ.get("HOME") or environ.get("USERPROFILE", "")
    places = [place.replace("~", home) for place in platform.pythons if home or not place.startswith("~")]
    if environ.get("PYENV_ROOT"):
        places.append(os.path.join(environ["PYENV_ROOT"], "versions", "*", *platform.in_environment[-1:]))
    if (uv := shutil.which("uv", path=path)) and (folder := _said([uv, "python", "dir"])):
        places += [os.path.join(folder[0], "*", name) for name in platform.in_environment]
    for place in places:
        yield from sorted(glob.glob(place))
    if launcher := shutil.which("py", path=path):
        for major, minor in VERSIONS:
            yield from _said(
                [launcher, f"-{major}.{minor}", "-I", "-c", "import sys; print(sys.executable)"]
            )[:1]
    if own:
        yield own


def asked(path: str, said: Callable[[list[str]], list[str]] | None = None) -> Version | None:
    """The version of a Python that can make environments; None if it cannot, or is none."""
    try:
        [line] = (said or _said)([path, "-I", "-c", _ASK])
        major, minor = parse_json(line)
    except ValueError:
        return None
    return int(major), int(minor)


def _said(command: list[str]) -> list[str]:
    """Lines that a command printed; none if it failed."""
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=_TIMEOUT_S, check=False, stdin=subprocess.DEVNULL
        )
    except (OSError, subprocess.TimeoutExpired):
        return []
    return done.stdout.splitlines() if done.returncode == 0 else []
