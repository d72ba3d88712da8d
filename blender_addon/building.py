# SPDX-License-Identifier: GPL-3.0-or-later
"""The build of this Blender: started on a scene's settings, shown by a picture and a text.

It outlives the file and the window that it was started from: its clock is a timer that Blender keeps.
"""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING

import bpy

from generator.errors import HeadturnError

from . import folders, own, pictures, session, settings, windows
from .core.build import Build
from .core.progress import Told
from .session import TICK_S, Shown

if TYPE_CHECKING:
    from .core.forecast import Rate

REPORT = "Headturn report"
LAST_IMAGE = "build/last"

current = Build()
_like: list[tuple[str, int]] = []
_rates: list[Rate | None] = []


def begin(shown: Shown) -> None:
    """Start the host on the settings as they are now, and follow it. Raises HeadturnError."""
    arguments, out = _order(shown)
    scene = settings.is_of_scene(shown)
    forget()
    current.expect(out)
    session.with_host(lambda: _start(arguments, out, scene=scene))
    if not bpy.app.timers.is_registered(_tick):
        bpy.app.timers.register(_tick, first_interval=TICK_S, persistent=True)


def run(shown: Shown) -> None:
    """The same, but wait for its end; how far it is goes to stdout. HeadturnError: it cannot start."""
    arguments, out = _order(shown)
    forget()
    session.find_host()
    current.expect(out)
    _start(arguments, out, scene=settings.is_of_scene(shown))
    told = Told()
    while current.runs:
        try:
            poll()
            for line in told.new(current.progress):
                print(line, flush=True)
            time.sleep(0.05)
        except KeyboardInterrupt:
            current.cancel()


def forget() -> None:
    """What the last build came to no longer counts."""
    current.forget()
    pictures.forget(LAST_IMAGE)


def close() -> None:
    """End the build: Blender ends, or the extension is disabled."""
    if bpy.app.timers.is_registered(_tick):
        bpy.app.timers.unregister(_tick)
    current.close()


def report() -> bpy.types.Text:
    """What the last build came to, as a text of the file that is open."""
    text: bpy.types.Text = own.kept(bpy.data.texts, REPORT) or bpy.data.texts.new(REPORT)
    own.keep(text, REPORT)
    text.from_string(current.report)
    return text


def poll() -> bool:
    """Take in what the host said. True if anything changed."""
    newest = current.newest
    changed = current.poll()
    if changed and current.exit_code == 0 and _like:
        _keep_rate()
    if current.newest is not None and current.newest != newest:
        pictures.keep(LAST_IMAGE, current.newest)
        changed = True
    return changed


def last_rate() -> Rate | None:
    """What an image of the last build that went well took; read once."""
    if not _rates:
        from .core.forecast import load

        _rates.append(load(_rate_file()))
    return _rates[0]


def _keep_rate() -> None:
    from .core.forecast import rate_of, save

    rate = rate_of(current, *_like.pop())
    if rate is not None:
        save(rate, _rate_file())
        _rates[:] = [rate]


def _rate_file() -> Path:
    return folders.lasting("rates") / "last.json"


def _order(shown: Shown) -> tuple[list[str], Path]:
    """(arguments of the host, folder of the dataset), whatever becomes of the scene. Raises HeadturnError."""
    out = settings.absolute(shown.out)
    configuration = folders.scratch("build") / "headturn-build.toml"
    settings.save(shown, configuration)
    arguments = ["build", str(configuration), "--out", out, "--json"]
    from .core.forecast import likeness

    _like[:] = [likeness(settings.to_config(shown), shown.workers)]
    if shown.workers:
        arguments += ["--workers", str(shown.workers)]
    return arguments, Path(out)


def _start(arguments: list[str], out: Path, *, scene: bool) -> None:
    from .core.process import HostProcess

    if not current.starting:  # it was cancelled while the host was looked for
        return
    try:
        current.start(HostProcess(session.host_command(arguments, scene=scene)), out)
    except HeadturnError as error:
        current.refuse(str(error))


def _tick() -> float | None:
    """For a timer: seconds until the next time, None once there is nothing to follow."""
    if current.starting and not session.state.checking:
        current.refuse(session.state.error)
    if poll() or not current.runs:
        windows.redraw()
    return TICK_S if current.runs else None
