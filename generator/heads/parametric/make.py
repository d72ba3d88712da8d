# SPDX-License-Identifier: GPL-3.0-or-later
"""Make folders of parametric heads."""

from __future__ import annotations

import hashlib
import re
import shutil
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np

from generator.errors import HeadError, UsageError
from generator.heads.card import CARD_NAME, MAX_CARD_BYTES
from generator.heads.head import NEUTRAL, Made, Maker, Wish
from generator.heads.parametric.appearance import Appearance, hair_tone, sample_appearance
from generator.heads.parametric.atlas import head_atlas
from generator.heads.parametric.compose import HeadShape, head_shape, head_vertices
from generator.heads.parametric.curtain import paint_curtain
from generator.heads.parametric.expression import NEUTRAL_EXPRESSION, Expression, sample_expression
from generator.heads.parametric.eyes import paint_eye
from generator.heads.parametric.folder import write_description, write_materials, write_mesh, write_texture
from generator.heads.parametric.identity import Identity, sample_identity
from generator.heads.parametric.skin import paint_skin
from generator.heads.parametric.source import data_folder
from generator.heads.parametric.workers import spread_heads
from generator.limits import MAX_HEADS, MAX_SEED
from generator.reading import MAX_STATE_BYTES, parse_json, read_limited
from generator.sealed import SEAL, unsealed

LICENSE = "CC0-1.0"
ATTRIBUTION = (
    "Made by Headturn from MakeHuman's CC0 base mesh and targets (MakeHuman team) "
    "and the CC0 face units of Mika Suominen"
)
FILES = "files"
"""Of head.json: SHA-256 of every file beside it."""

_HEAD_NAME = re.compile(r"s\d+p\d{4,}")


def make_heads(
    out: Path,
    *,
    count: int,
    seed: int,
    expressions: int = 0,
    progress: Callable[[str], None] | None = None,
    keep: bool = False,
    workers: int | None = None,
) -> list[Path]:
    """Write heads ``s<seed>p0000`` ... below out and return their folders.

    Head k of a seed is the same whatever count is, and so is expression j of a
    head whatever expressions is; how many processes are at work changes nothing.
    A folder is complete or absent: each is written beside its place and renamed. Folders
    that are already there are replaced, or kept if keep is set, they hold the expressions
    asked for, and their files are as they were made.

    Parameters
    ----------
    out: made if missing; may hold earlier parametric heads and nothing else.
    count: number of identities, at least 1. seed: 0 or larger.
    expressions: sampled expressions an identity besides the neutral one.
    progress: called with the name of every head once it is there.
    workers: processes at most; default one a core, where there is enough to do.

    Raises
    ------
    UsageError: a number is out of range, or out holds something else.
    HeadError: the data are not installed, a file cannot be written, or a process was killed.
    """
    if count < 1:
        raise UsageError(f"count is {count}: ask for at least 1 head")
    if not 0 <= seed <= MAX_SEED:
        raise UsageError(f"seed is {seed}: it must be from 0 to {MAX_SEED}")
    if expressions < 0:
        raise UsageError(f"expressions is {expressions}: it must be 0 or larger")
    if count * (1 + expressions) > MAX_HEADS:
        raise UsageError(f"{count} heads with {expressions} expressions each: more than {MAX_HEADS:,} meshes")
    data_folder()
    _prepare(out)
    last = expression_name(expressions) if expressions else NEUTRAL
    folders = [out / head_name(seed, index) for index in range(count)]
    missing = []
    for index, folder in enumerate(folders):
        if not (keep and _is_whole(folder, last)):
            missing.append(index)
        elif progress is not None:
            progress(folder.name)
    make = partial(_make_head, out, seed, expressions)
    for name in spread_heads(make, missing, workers, _prepare_process):
        if progress is not None:
            progress(name)
    return folders


def _prepare_process() -> None:
    head_atlas()


def _make_head(out: Path, seed: int, expressions: int, index: int) -> str:
    folder = out / head_name(seed, index)
    try:
        _write_head(folder, seed, index, expressions)
    except OSError as error:
        reason = f"cannot be written ({error.strerror}); check space and permissions"
        raise HeadError(f"{folder}: {reason}") from error
    return folder.name


def head_name(seed: int, index: int) -> str:
    """Subject, and name of the folder, of head ``index`` of a seed."""
    return f"s{seed}p{index:04d}"


def expression_name(number: int) -> str:
    """Name of a head's sampled expression, numbered from 1."""
    return f"expression_{number:02d}"


def sample_head(seed: int, index: int) -> tuple[Identity, Appearance, HeadShape]:
    """Head ``index`` of a seed: its parameters and its shape."""
    identity = sample_identity(np.random.default_rng([seed, index, 0]))
    appearance = sample_appearance(np.random.default_rng([seed, index, 1]), identity)
    return identity, appearance, head_shape(identity, appearance, np.random.default_rng([seed, index, 2]))


def _write_head(folder: Path, seed: int, index: int, expressions: int) -> None:
    work = folder.with_name(f".{folder.name}.tmp")
    shutil.rmtree(work, ignore_errors=True)
    try:
        work.mkdir()
        _fill(work, folder.name, seed, index, expressions)
        if folder.exists():
            shutil.rmtree(folder)
        work.rename(folder)
    finally:
        shutil.rmtree(work, ignore_errors=True)


def _fill(work: Path, subject: str, seed: int, index: int, expressions: int) -> None:
    """Write all files of a head into a folder."""
    identity, appearance, shape = sample_head(seed, index)
    paint = np.random.default_rng([seed, index, 3])
    long_hair = shape.curtain is not None
    described = {}
    for number in range(expressions + 1):
        name, expression = NEUTRAL, NEUTRAL_EXPRESSION
        if number:
            name = expression_name(number)
            expression = sample_expression(np.random.default_rng([seed, index, 4, number]))
        write_mesh(work / f"{name}.obj", head_vertices(shape, expression), long_hair)
        described[name] = _describe_expression(f"{name}.obj", expression)
    write_materials(work, np.minimum(hair_tone(appearance) * 0.6, 0.12), long_hair)
    write_texture(work / "skin.png", paint_skin(head_atlas(), appearance, paint))
    write_texture(work / "eye.png", paint_eye(appearance, paint))
    if long_hair:
        write_texture(work / "hair.png", paint_curtain(appearance, paint))
    made = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(work.iterdir())}
    write_description(
        work / CARD_NAME,
        {
            "source": "parametric",
            "subject": subject,
            "license": LICENSE,
            "redistributable": True,
            "attribution": ATTRIBUTION,
            "units": "mm",
            "up": "+Y",
            "forward": "+Z",
            "expressions": described,
            "parameters": {
                "seed": seed,
                "index": index,
                "scale_mm_per_dm": shape.scale,
                "identity": asdict(identity),
                "appearance": asdict(appearance),
            },
            FILES: made,
        },
    )


def _is_whole(folder: Path, last: str) -> bool:
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


def _describe_expression(mesh: str, expression: Expression) -> dict:
    return {"file": mesh} | asdict(expression)


def _prepare(out: Path) -> None:
    """Make out, or check that it holds only heads made here."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        entries = sorted(out.iterdir())
    except OSError as error:
        reason = f"not a folder that can be written ({error.strerror}); choose another"
        raise UsageError(f"{out}: {reason}") from error
    for entry in entries:
        name = entry.name.removeprefix(".").removesuffix(".tmp")
        if not (entry.is_dir() and _HEAD_NAME.fullmatch(name)):
            raise UsageError(f"{out}: holds {entry.name}, not a parametric head; choose an empty folder")


def _make(folder: Path, wish: Wish, made: Callable[[], None]) -> Made:
    if wish.argument:
        raise UsageError(f"--heads parametric:{wish.argument}: parametric heads take no argument")
    make_heads(
        folder,
        count=wish.count,
        seed=wish.seed,
        expressions=wish.sampled_expressions,
        progress=lambda _: made(),
        keep=True,
        workers=wish.workers,
    )
    sampled = (expression_name(number) for number in range(1, wish.sampled_expressions + 1))
    return Made(tuple(head_name(wish.seed, k) for k in range(wish.count)), (NEUTRAL, *sampled))


MAKER = Maker(_make)
