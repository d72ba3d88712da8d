# SPDX-License-Identifier: GPL-3.0-or-later
"""``headturn`` commands from inside ``blender --background``: same host, same bytes, same exit codes."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from generator.errors import HeadturnError
from generator.escape import printable
from generator.interpreter import python_environment

from .host import HostMissing, check_host, find_host, host_command, install_commands
from .process import HostProcess
from .progress import Progress, Told


def run(
    arguments: Sequence[str], *, preference: str = "", blender: str = "", set_up: Path | None = None
) -> int:
    """Carry out one headturn command on the host and return its exit code.

    Progress of a build is printed to stdout a line at a time, for logs of a
    render node; with --json the events themselves go there.
    """
    arguments = list(arguments) or ["--help"]
    try:
        configuration = next((Path(a) for a in arguments if a.endswith(".toml")), None)
        beside = configuration.absolute().parent if configuration else Path.cwd()
        host = find_host(preference, beside, set_up=set_up)
        command = host_command(host, check_host(host), arguments, blender)
        if arguments[0] == "build" and not {"--json", "--help"} & set(arguments):
            return _build(command)
        return _pass_through(command)
    except HostMissing as error:
        lines = [f"headturn: {error}", "or make an environment by hand:", *install_commands()]
        print("\n  ".join(map(printable, lines)), file=sys.stderr, flush=True)
        return error.exit_code
    except HeadturnError as error:
        print(printable(f"headturn: {error}"), file=sys.stderr, flush=True)
        return error.exit_code


def _pass_through(command: list[str]) -> int:
    sys.stdout.flush()
    process = subprocess.Popen(command, env=python_environment(), stdin=subprocess.DEVNULL)
    while True:
        try:
            return _shell_code(process.wait())
        except KeyboardInterrupt:  # the terminal has sent it to the host as well
            continue


def _build(command: list[str]) -> int:
    process = HostProcess([*command, "--json"])
    previous = signal.signal(signal.SIGTERM, lambda *_: process.interrupt())
    progress, told = Progress(), Told()
    try:
        while (code := process.exit_code) is None:
            try:
                for event in process.poll():
                    progress.take(event)
                for line in told.new(progress):
                    print(printable(line), flush=True)
                time.sleep(0.05)
            except KeyboardInterrupt:
                process.interrupt()
    finally:
        signal.signal(signal.SIGTERM, previous)
        process.close()
    if progress.result is not None:
        result = progress.result
        print(printable(f"{progress.line()} in {result['seconds']:.0f} s: {result['dataset']}"))
        print(printable(f"digest {result['digest']}"), flush=True)
    for line in process.log:
        print(printable(line), file=sys.stderr, flush=True)
    return _shell_code(code)


def _shell_code(code: int) -> int:
    """A process that a signal ended has a negative code, which no shell can show."""
    return 128 - code if code < 0 else code
