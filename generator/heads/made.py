# SPDX-License-Identifier: GPL-3.0-or-later
"""Folders of heads that are made here: complete or absent, and known again by their checksums."""

from __future__ import annotations

import hashlib
import json
import re
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from generator.cgroup import worthwhile
from generator.errors import HeadError, UsageError, WorkerError
from generator.heads.card import CARD_NAME, MAX_CARD_BYTES
from generator.limits import MAX_HEADS, MAX_SEED
from generator.pool import processes
from generator.process import available_cores
from generator.reading import MAX_STATE_BYTES, parse_json, read_limited
from generator.sealed import SEAL, sealed, unsealed

HEADS_A_WORKER = 12
"""A further process, which works out anew what heads have in common, pays from so many heads on."""

FILES = "files"
"""Of head.json: SHA-256 of every file beside it."""


def check_numbers(count: int, seed: int, expressions: int) -> None:
    """UsageError: no heads can be made of these numbers."""
    if count < 1:
        raise UsageError(f"count is {count}: ask for at least 1 head")
    if not 0 <= seed <= MAX_SEED:
        raise UsageError(f"seed is {seed}: it must be from 0 to {MAX_SEED}")
    if expressions < 0:
        raise UsageError(f"expressions is {expressions}: it must be 0 or larger")
    if count * (1 + expressions) > MAX_HEADS:
        raise UsageError(f"{count} heads with {expressions} expressions each: more than {MAX_HEADS:,} meshes")


def expression_name(number: int) -> str:
    """Name of a head's sampled expression, numbered from 1."""
    return f"expression_{number:02d}"


def prepare_folder(out: Path, name: re.Pattern[str], what: str) -> None:
    """Make out, or check that it holds only heads made here.

    name: of a head's folder. what: such heads are, in words. Raises UsageError: it holds something else,
    or cannot be written.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        entries = sorted(out.iterdir())
    except OSError as error:
        reason = f"not a folder that can be written ({error.strerror}); choose another"
        raise UsageError(f"{out}: {reason}") from error
    for entry in entries:
        plain = entry.name.removeprefix(".").removesuffix(".tmp")
        if not (entry.is_dir() and name.fullmatch(plain)):
            raise UsageError(f"{out}: holds {entry.name}, not {what}; choose an empty folder")


def make_folders(
    folders: Sequence[Path],
    last: str,
    make: Callable[[int], str],
    prepare: Callable[[], None],
    *,
    keep: bool,
    progress: Callable[[str], None] | None,
    workers: int | None,
) -> None:
    """Make the heads of some folders, each in a process of several where there is enough to do.

    Parameters
    ----------
    last: the expression that is written last.
    make: writes the head of a number and returns its name; of a module, or a partial of one.
    prepare: works out what heads have in common, in a process that is going to make some.
    keep: leave folders that are whole. progress: called with the name of every head once it is there.
    workers: processes at most; default one a core, where there is enough to do.

    Raises
    ------
    HeadError: a file cannot be written, or a process was killed.
    """
    missing = []
    for index, folder in enumerate(folders):
        if not (keep and is_whole(folder, last)):
            missing.append(index)
        elif progress is not None:
            progress(folder.name)
    for name in _spread(make, prepare, missing, workers):
        if progress is not None:
            progress(name)


def _spread(
    make: Callable[[int], str], prepare: Callable[[], None], missing: list[int], workers: int | None
) -> Iterator[str]:
    """The names of the heads of these numbers, in their order, each as soon as it is there."""
    enough = 1 + len(missing) // HEADS_A_WORKER
    workers = min(workers or enough, worthwhile(available_cores()), enough)
    if workers < 2:
        yield from map(make, missing)
        return
    try:
        with processes(workers, prepare) as spread:
            yield from spread(make, missing, 1)
    except WorkerError as error:
        raise HeadError(
            "a process that was making heads was killed, perhaps for memory; the heads that are there are "
            "whole. Run it again with --workers 1"
        ) from error


@contextmanager
def whole_folder(folder: Path) -> Iterator[Path]:
    """A folder to write into, which takes the place of folder when all went well.

    Raises HeadError: it cannot be written.
    """
    work = folder.with_name(f".{folder.name}.tmp")
    shutil.rmtree(work, ignore_errors=True)
    try:
        work.mkdir()
        yield work
        if folder.exists():
            shutil.rmtree(folder)
        work.rename(folder)
    except OSError as error:
        reason = f"cannot be written ({error.strerror}); check space and permissions"
        raise HeadError(f"{folder}: {reason}") from error
    finally:
        shutil.rmtree(work, ignore_errors=True)


def write_card(folder: Path, description: dict[str, Any]) -> None:
    """Write head.json: a description, checksums of all files that are there by now, and its own."""
    made = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(folder.iterdir())}
    text = json.dumps(sealed({**description, FILES: made}), indent=1) + "\n"
    (folder / CARD_NAME).write_text(text, encoding="utf-8", newline="\n")


def is_whole(folder: Path, last: str) -> bool:
    """Does a folder hold the expressions up to one of this name, all as they were made?

    Heads of the first release have no checksums: what is there of them is taken.
    """
    if not (folder / f"{last}.obj").is_file():
        return False
    try:
        card = parse_json(read_limited(folder / CARD_NAME, MAX_CARD_BYTES))
        if FILES not in card and SEAL not in card:
            return True
        made: dict[str, str] = unsealed(card)[FILES]
        return all(
            hashlib.sha256(read_limited(folder / name, MAX_STATE_BYTES)).hexdigest() == sha256
            for name, sha256 in made.items()
        )
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False  # made again, and the same
