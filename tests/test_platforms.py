# SPDX-License-Identifier: GPL-3.0-or-later
"""What differs between operating systems, on one that is none of the others."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from blender_addon.core import host
from blender_addon.core.process import HostProcess
from generator import platforms
from generator.platforms import HERE, MacOS, Platform, Windows, platform_of, relative_path


class Child:
    """Takes signals; where it has no console it takes none."""

    def __init__(self, console: bool = True) -> None:
        self.got: list[object] = []
        self._console = console

    def send_signal(self, number: int) -> None:
        if not self._console:
            raise OSError(6, "The handle is invalid")
        self.got.append(number)

    def terminate(self) -> None:
        self.got.append("terminated")


class Kernel:
    """kernel32 with processes 7, which runs, 8, which has ended but is open yet, and 9, another user's."""

    def __init__(self) -> None:
        self.closed: list[int] = []
        self.error = 0
        self.OpenProcess: Any = lambda *asked: self._open(*asked)

    def _open(self, access: int, inherit: bool, pid: int) -> int:
        assert access == 0x100000, "SYNCHRONIZE, which needs least"
        self.error = {7: 0, 8: 0, 9: 5}.get(pid, 87)
        return pid if not self.error else 0

    def WaitForSingleObject(self, handle: Any, milliseconds: int) -> int:
        assert milliseconds == 0
        return 0x102 if handle.value == 7 else 0

    def CloseHandle(self, handle: Any) -> None:
        self.closed.append(handle.value)


def test_the_platform_is_the_one_that_python_names() -> None:
    assert [type(platform_of(name)) for name in ("linux", "win32", "darwin", "freebsd14")] == [
        Platform,
        Windows,
        MacOS,
        Platform,
    ]


def test_a_process_of_windows_is_asked_without_a_signal(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel, windows = Kernel(), Windows()
    monkeypatch.setattr(windows, "_kernel", lambda: (kernel, lambda: kernel.error))
    monkeypatch.setattr(os, "kill", lambda *_: pytest.fail("os.kill(pid, 0) is Ctrl-C on Windows"))
    assert [windows.is_running(pid) for pid in (7, 8, 9, 10)] == [True, False, True, False]
    assert kernel.closed == [7, 8]


def test_a_process_of_this_machine_is_there_until_it_is_not() -> None:
    child = subprocess.Popen([sys.executable, "-c", "input()"], stdin=subprocess.PIPE)
    assert HERE.is_running(child.pid) and HERE.is_running(1)
    child.communicate(b"\n")
    assert not HERE.is_running(child.pid)


def test_cancel_is_ctrl_break_on_windows_and_a_group_of_its_own() -> None:
    windows = Windows()
    assert windows.own_group() == {"creationflags": 0x200}
    for console, got in ((True, [1]), (False, ["terminated"])):
        child = Child(console)
        windows.interrupt(child)
        assert child.got == got
    child = Child()
    Platform().interrupt(child)
    assert child.got == [15] and Platform().own_group() == {"start_new_session": True}


HEEDS = """
import signal, sys
sys.platform, signal.SIGBREAK = "win32", signal.SIGUSR1
from generator.execution.stopping import Stopped, stoppable
assert signal.SIGHUP != signal.SIGBREAK
try:
    with stoppable():
        signal.raise_signal(signal.SIGUSR1)
        print("went on")
except Stopped as stopped:
    print(stopped.exit_code - 128 == signal.SIGUSR1, "and time to clean up")
"""


def test_the_host_heeds_ctrl_break() -> None:
    """With a signal of this machine in the place of SIGBREAK."""
    done = subprocess.run([sys.executable, "-c", HEEDS], capture_output=True, text=True, check=True)
    assert done.stdout == "True and time to clean up\n"


def test_a_host_is_started_and_ended_as_the_platform_says(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []

    class Elsewhere(Platform):
        def own_group(self) -> dict[str, Any]:
            asked.append("group")
            return super().own_group()

        def interrupt(self, child: platforms.Child) -> None:
            asked.append("interrupt")
            super().interrupt(child)

    monkeypatch.setattr("blender_addon.core.process.HERE", Elsewhere())
    process = HostProcess([sys.executable, "-c", "import time; time.sleep(60)"])
    process.close()
    assert asked == ["group", "interrupt"]


def test_an_environment_of_windows_has_its_python_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    python = tmp_path / "Scripts" / "python.exe"
    python.parent.mkdir()
    python.write_text("")
    python.chmod(0o755)
    with pytest.raises(host.HostMissing):
        host.find_host(str(tmp_path), None, {})
    monkeypatch.setattr(host, "HERE", Windows())
    assert host.find_host(str(tmp_path), None, {}).command[0] == str(python)


def test_a_blender_from_the_dock_looks_in_the_usual_places(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    command = tmp_path / ".local" / "bin" / "headturn"
    command.parent.mkdir(parents=True)
    command.write_text("#!/bin/sh\n")
    command.chmod(0o755)
    of_the_dock = {"HOME": str(tmp_path), "PATH": "/usr/bin:/bin:/usr/sbin:/sbin"}
    monkeypatch.setattr(host, "HERE", Platform())
    with pytest.raises(host.HostMissing):
        host.find_host("", None, of_the_dock)
    monkeypatch.setattr(host, "HERE", MacOS())
    assert host.find_host("", None, of_the_dock).command == (str(command),)
    path = MacOS().search_path({"PATH": "/bin"}).split(os.pathsep)
    assert path[0] == "/bin" and "/opt/homebrew/bin" in path and not any(p.startswith("~") for p in path)


def test_commands_are_quoted_as_they_are_typed() -> None:
    command = ["/a b/python", "-m", "pip", "headturn[build]"]
    assert Platform().quoted(command) == "'/a b/python' -m pip 'headturn[build]'"
    assert Windows().quoted(command) == '"/a b/python" -m pip headturn[build]'


def test_a_texture_on_another_drive_keeps_its_whole_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert relative_path(tmp_path / "textures" / "skin.png", tmp_path / "scenes") == "../textures/skin.png"

    def another_drive(*_: object) -> str:
        raise ValueError("path is on mount 'D:', start on mount 'C:'")

    monkeypatch.setattr(os.path, "relpath", another_drive)
    there = relative_path(tmp_path / "skin.png", tmp_path / "scenes")
    assert there == f"{tmp_path.as_posix()}/skin.png" and tmp_path / "scenes" / there == tmp_path / "skin.png"
