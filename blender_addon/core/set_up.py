# SPDX-License-Identifier: GPL-3.0-or-later
"""The environment of the host, made for somebody who has none: in a thread, with progress and a way out."""

from __future__ import annotations

import json
import shutil
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from pathlib import Path

from generator.errors import HeadturnError, UsageError, WorkerError
from generator.escape import printable
from generator.interpreter import python_environment
from generator.platforms import HERE
from generator.reading import parse_json

from .host import HEADS, check_host, host_of, python_of
from .pythons import NoPython
from .room import size

READY = "headturn.json"
"""Written into an environment last: which release it is of. One without it was never finished."""

PACKAGES = 60
"""So many a build takes, about; for the progress bar alone."""

_LOG_LINES = 200
_SAID = {"Collecting": "finding", "Downloading": "fetching", "Building": "building"}
"""First words of pip's lines, and what they mean."""


def is_ready(folder: Path, version: str) -> bool:
    """Does an environment hold this release, all of it?"""
    try:
        return bool(parse_json((folder / READY).read_text(encoding="utf-8"))["headturn"] == version)
    except (OSError, ValueError, KeyError, TypeError):
        return False


class SetUp:
    """Makes an environment and installs a wheel there. Nothing here waits: whoever draws looks at it.

    line: what goes on, or what it came to. share: 0-1, about. error: why it failed; "" otherwise.
    commands: what may help then.
    """

    def __init__(self) -> None:
        self.line, self.share, self.error, self.runs = "", 0.0, "", False
        self.commands: tuple[str, ...] = ()
        self._stopped = False
        self._process: subprocess.Popen[str] | None = None
        self._log: deque[str] = deque(maxlen=_LOG_LINES)

    @property
    def log(self) -> str:
        """What was run, and what that printed last."""
        return "\n".join(self._log)

    def start(self, folder: Path, wheel: Path, version: str, find: Callable[[], str]) -> None:
        """Begin. find: the Python to make the environment of, looked for in a thread. See :meth:`make`."""
        self.line, self.share, self.error, self.runs = "looking for Python 3.11", 0.0, "", True
        self._stopped, self.commands = False, ()
        self._log.clear()
        threading.Thread(target=self._in_thread, args=(folder, wheel, version, find), daemon=True).start()

    def cancel(self) -> None:
        """End it; what there is of the environment counts for nothing."""
        self._stopped = True
        if self._process is not None and self._process.poll() is None:
            HERE.interrupt(self._process)

    def _in_thread(self, *given: object) -> None:
        try:
            self.make(*given)  # type: ignore[arg-type]
        except NoPython as error:
            self.error, self.commands = str(error), error.commands
        except HeadturnError as error:
            self.error = "" if self._stopped else str(error)
            self.line = "stopped" if self._stopped else ""
        except OSError as error:
            self.error = f"{error.filename}: {error.strerror}"
        finally:
            self.runs = False

    def make(self, folder: Path, wheel: Path, version: str, find: Callable[[], str]) -> None:
        """Make the environment folder, in place of what is there. Raises HeadturnError or OSError."""
        if not wheel.is_file():
            raise UsageError(f"{wheel}: not there; install the extension from its zip (make extension)")
        began = time.monotonic()
        python = find()
        self._say(f"making an environment with {python}", 0.02)
        shutil.rmtree(folder, ignore_errors=True)
        self._run([python, "-I", "-m", "venv", str(folder)])
        inside = python_of(folder)
        if inside is None:
            raise UsageError(f"{python} made no environment in {folder}")
        pip = [str(inside), "-I", "-m", "pip", "--disable-pip-version-check", "--no-input", "install"]
        self._say("asking for packages", 0.05)
        self._run([*pip, f"headturn[build] @ {wheel.absolute().as_uri()}"])
        self._say("parametric heads", 0.95)
        self._run([*pip, "--no-deps", HEADS])
        self._say("checking", 0.97)
        facts = check_host(host_of(folder, "Set Up"))
        if facts.problem:
            raise UsageError(facts.problem)
        (folder / READY).write_text(json.dumps({"headturn": version}), encoding="utf-8")
        took = f"{size(folder) / 1e9:.1f} GB in {time.monotonic() - began:.0f} s"
        self._say(f"Headturn {facts.headturn} is set up, with Python {facts.python}: {took}", 1.0)

    def _say(self, line: str, share: float) -> None:
        self.line, self.share = line, share

    def _run(self, command: Sequence[str]) -> None:
        """Run a command to its end. Raises WorkerError if it fails, or if somebody has had enough."""
        if self._stopped:
            raise WorkerError("stopped")
        self._log.append(f"$ {HERE.quoted(command)}")
        environment = python_environment()
        environment.pop("PYTHONHOME", None)
        try:
            with subprocess.Popen(
                command,
                env=environment,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                encoding="utf-8",
                errors="replace",
                **HERE.own_group(),
            ) as self._process:
                assert self._process.stdout is not None
                if self._stopped:
                    self.cancel()
                for line in self._process.stdout:
                    self._take(printable(line.strip()))
        except OSError as error:
            raise WorkerError(f"cannot start {command[0]}: {error.strerror}") from error
        if self._process.returncode:
            errors = [line for line in self._log if line.startswith("ERROR")] or [*self._log][-1:]
            raise WorkerError(f"{' '.join(errors[-1:])}; Copy Log has the rest")

    def _take(self, line: str) -> None:
        if not line:
            return
        self._log.append(line)
        word, *rest = line.split()
        if line.startswith("Installing collected packages"):
            self._say("installing all of them, a minute or two", 0.87)
        elif word in _SAID and rest:
            step = 0.8 / PACKAGES if word == "Collecting" else 0.0
            self._say(f"{_SAID[word]} {rest[0].split('/')[-1]}", min(self.share + step, 0.85))
