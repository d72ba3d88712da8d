# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of the extension: what goes with this Blender, and what lasts."""

from __future__ import annotations

import hashlib
import json
import secrets
import shutil
import tempfile
from pathlib import Path
from typing import Any

import bpy

from generator import __version__
from generator.plan.settings import Values

from .core.found import HeadName
from .core.room import make_room, use
from .core.tables import section_of

LASTING_BYTES = 2 * 2**30
"""Heads that were loaded are kept up to so much; those that were not used for longest go first."""

_scratch: list[Path] = []
_NAME = secrets.token_hex(4)
"""Of this Blender: another one may place the same heads at the same time."""


def scratch(name: str) -> Path:
    """A folder of this Blender alone, whoever else runs one; it is gone when the extension is."""
    if not _scratch or not _scratch[0].is_dir():
        _scratch[:] = [Path(tempfile.mkdtemp(prefix="headturn-", dir=bpy.app.tempdir or None))]
    folder = _scratch[0] / name
    folder.mkdir(exist_ok=True)
    return folder


def lasting(name: str) -> Path:
    """A folder of the extension that this user keeps from one day to the next."""
    return Path(bpy.utils.extension_path_user(__package__, path=name, create=True))


def made(config: Values) -> Path:
    """Where heads that are made on the spot are made. Another release may make others."""
    heads = section_of(config, "heads")
    key = [__version__, heads.source, heads.count, heads.seed, heads.sampled_expressions]
    return lasting("made") / hashlib.sha256(json.dumps(key).encode()).hexdigest()[:16]


def environment() -> Path:
    """Where Set Up makes the host's environment."""
    return lasting("environment")


def told(config: Values) -> dict[str, Any]:
    """What the host is told of a configuration whenever it needs its heads."""
    return {"config": config, "made": str(made(config)), "progress": True}


def placed(key: str, head: HeadName) -> Path:
    """The package of a placed head, in a folder that is there. key: of how it is placed."""
    folder = lasting("heads") / f"{key}-{_NAME}"
    folder.mkdir(exist_ok=True)
    use(folder)
    return folder / f"{'-'.join(head)}.npz"


def tidy() -> None:
    """Keep what lasts within its limit."""
    make_room([lasting("made"), lasting("heads")], LASTING_BYTES)


def remove_scratch() -> None:
    """The extension ends."""
    while _scratch:
        shutil.rmtree(_scratch.pop(), ignore_errors=True)
