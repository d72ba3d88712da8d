# SPDX-License-Identifier: GPL-3.0-or-later
"""What differs between operating systems where processes and programs are concerned. stdlib only.

Whoever starts, ends or looks for a process asks :data:`HERE`. Windows and macOS were never run: what stands
here is as their makers document it, and the tests pretend to be there.
"""

from __future__ import annotations

import ctypes
import os
import shlex
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol


class Child(Protocol):
    """A process that was started, such as a :class:`subprocess.Popen`."""

    def send_signal(self, number: int, /) -> None:
        """Send it a signal. Raises OSError."""
        ...

    def terminate(self) -> None:
        """End it."""
        ...


class Platform:
    """Linux, and what is like it; the others say where they differ."""

    in_environment: tuple[str, ...] = ("bin/python",)
    """Where an environment has its Python."""

    ending: tuple[str, ...] = ("SIGINT", "SIGTERM", "SIGHUP")
    """Names of the signals that ask a process to end."""

    places: tuple[str, ...] = ()
    """Folders of programs that are not on the PATH of what a desktop starts."""

    pythons: tuple[str, ...] = (
        "~/.pyenv/versions/*/bin/python",
        "~/.local/share/uv/python/*/bin/python",
    )
    """Where Pythons lie that are on no PATH: of pyenv, and those that uv manages."""

    python_311: tuple[str, ...] = ("python3.11",)
    """The command that is Python 3.11."""

    install_python: tuple[str, ...] = (
        "uv python install 3.11",
        "sudo apt install python3.11 python3.11-venv",
    )
    """Commands that install a Python; one of them will do."""

    def own_group(self) -> dict[str, Any]:
        """For Popen: Ctrl-C in a terminal is for the one that started the process, not for it."""
        return {"start_new_session": True}

    def interrupt(self, child: Child) -> None:
        """Ask a process with a group of its own to end in order.

        Not by SIGINT: programs started in the background, and what they start, ignore that.
        """
        child.send_signal(signal.SIGTERM)

    def is_running(self, pid: int) -> bool:
        """Is there a process with this id?"""
        try:
            os.kill(pid, 0)
        except ProcessLookupError:
            return False
        except PermissionError:
            return True
        return True

    def quoted(self, command: Sequence[str]) -> str:
        """A command as it is typed."""
        return shlex.join(command)

    def search_path(self, environ: Mapping[str, str]) -> str:
        """PATH, and behind it the usual places."""
        home = environ.get("HOME", "")
        usual = [place.replace("~", home) for place in self.places if home or not place.startswith("~")]
        return os.pathsep.join([environ.get("PATH", ""), *usual])


class MacOS(Platform):
    """A Blender started from the Dock has the system's own PATH, and no variable of a terminal."""

    places = ("~/.local/bin", "/opt/homebrew/bin", "/usr/local/bin", "/opt/local/bin")
    pythons = (
        *Platform.pythons,
        "/Library/Frameworks/Python.framework/Versions/*/bin/python3",
    )
    install_python = ("brew install python@3.11", "uv python install 3.11")


class Windows(Platform):
    """Of signals it has Ctrl-C and Ctrl-Break alone, and only the latter reaches a group of its own."""

    in_environment = ("Scripts/python.exe", "python.exe")
    ending = ("SIGINT", "SIGTERM", "SIGBREAK")
    places = ()
    python_311 = ("py", "-3.11")
    pythons = (
        "~/.pyenv/pyenv-win/versions/*/python.exe",
        "~/AppData/Roaming/uv/python/*/python.exe",
        "~/AppData/Local/Programs/Python/*/python.exe",
    )
    install_python = ("winget install Python.Python.3.11", "uv python install 3.11")

    CREATE_NEW_PROCESS_GROUP = 0x200
    CTRL_BREAK_EVENT = 1
    _SYNCHRONIZE, _WAIT_TIMEOUT, _ACCESS_DENIED = 0x100000, 0x102, 5

    def own_group(self) -> dict[str, Any]:
        """In our console all the same: Ctrl-Break goes no farther."""
        return {"creationflags": self.CREATE_NEW_PROCESS_GROUP}

    def interrupt(self, child: Child) -> None:
        """By Ctrl-Break; where there is no console to send it in, the process just ends."""
        try:
            child.send_signal(self.CTRL_BREAK_EVENT)
        except OSError:
            child.terminate()

    def is_running(self, pid: int) -> bool:
        """os.kill would send Ctrl-C here. One of another user is there, too, though it cannot be opened."""
        kernel, last_error = self._kernel()
        kernel.OpenProcess.restype = ctypes.c_void_p
        handle = kernel.OpenProcess(self._SYNCHRONIZE, False, pid)
        if not handle:
            return bool(last_error() == self._ACCESS_DENIED)
        try:
            return bool(kernel.WaitForSingleObject(ctypes.c_void_p(handle), 0) == self._WAIT_TIMEOUT)
        finally:
            kernel.CloseHandle(ctypes.c_void_p(handle))

    def quoted(self, command: Sequence[str]) -> str:
        """As cmd reads it, and PowerShell where the program's own path needs no quotes."""
        return subprocess.list2cmdline(command)

    def _kernel(self) -> tuple[Any, Any]:
        """kernel32, and what says why its last call failed."""
        library = getattr(ctypes, "WinDLL")  # noqa: B009  there is none elsewhere
        return library("kernel32", use_last_error=True), getattr(ctypes, "get_last_error")  # noqa: B009


def platform_of(name: str) -> Platform:
    """The platform that sys.platform names."""
    return {"win32": Windows, "darwin": MacOS}.get(name, Platform)()


HERE = platform_of(sys.platform)


def relative_path(path: Path, root: Path) -> str:
    """A path from a folder, with "/"; the whole path where there is none, on another drive of Windows."""
    try:
        return Path(os.path.relpath(path, root)).as_posix()
    except ValueError:
        return path.absolute().as_posix()
