# SPDX-License-Identifier: GPL-3.0-or-later
"""Make folders of parametric heads."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np

from generator.errors import UsageError
from generator.heads.head import NEUTRAL, Made, Maker, Wish
from generator.heads.made import (
    check_numbers,
    expression_name,
    make_folders,
    prepare_folder,
    whole_folder,
    write_card,
)
from generator.heads.parametric.appearance import Appearance, hair_tone, sample_appearance
from generator.heads.parametric.atlas import head_atlas
from generator.heads.parametric.compose import HeadShape, head_shape, head_vertices
from generator.heads.parametric.curtain import paint_curtain
from generator.heads.parametric.expression import Expression, expressions_of
from generator.heads.parametric.eyes import paint_eye
from generator.heads.parametric.folder import write_materials, write_mesh, write_texture
from generator.heads.parametric.identity import Identity, sample_identity
from generator.heads.parametric.skin import paint_skin
from generator.heads.parametric.source import data_folder

LICENSE = "CC0-1.0"
ATTRIBUTION = (
    "Made by Headturn from MakeHuman's CC0 base mesh and targets (MakeHuman team) "
    "and the CC0 face units of Mika Suominen"
)
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
    check_numbers(count, seed, expressions)
    data_folder()
    prepare_folder(out, _HEAD_NAME, "a parametric head")
    folders = [out / head_name(seed, index) for index in range(count)]
    make_folders(
        folders,
        expression_name(expressions) if expressions else NEUTRAL,
        partial(_make_head, out, seed, expressions),
        _prepare_process,
        keep=keep,
        progress=progress,
        workers=workers,
    )
    return folders


def _prepare_process() -> None:
    head_atlas()


def head_name(seed: int, index: int) -> str:
    """Subject, and name of the folder, of head ``index`` of a seed."""
    return f"s{seed}p{index:04d}"


def sample_head(seed: int, index: int) -> tuple[Identity, Appearance, HeadShape]:
    """Head ``index`` of a seed: its parameters and its shape."""
    identity = sample_identity(np.random.default_rng([seed, index, 0]))
    appearance = sample_appearance(np.random.default_rng([seed, index, 1]), identity)
    return identity, appearance, head_shape(identity, appearance, np.random.default_rng([seed, index, 2]))


def _make_head(out: Path, seed: int, expressions: int, index: int) -> str:
    name = head_name(seed, index)
    with whole_folder(out / name) as work:
        _fill(work, name, seed, index, expressions)
    return name


def _fill(work: Path, subject: str, seed: int, index: int, expressions: int) -> None:
    """Write all files of a head into a folder."""
    identity, appearance, shape = sample_head(seed, index)
    paint = np.random.default_rng([seed, index, 3])
    long_hair = shape.curtain is not None
    described = {}
    for name, expression in expressions_of(seed, index, expressions):
        write_mesh(work / f"{name}.obj", head_vertices(shape, expression), long_hair)
        described[name] = _describe_expression(f"{name}.obj", expression)
    write_materials(work, np.minimum(hair_tone(appearance) * 0.6, 0.12), long_hair)
    write_texture(work / "skin.png", paint_skin(head_atlas(), appearance, paint))
    write_texture(work / "eye.png", paint_eye(appearance, paint))
    if long_hair:
        write_texture(work / "hair.png", paint_curtain(appearance, paint))
    write_card(
        work,
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
        },
    )


def _describe_expression(mesh: str, expression: Expression) -> dict:
    return {"file": mesh} | asdict(expression)


def _make(folder: Path, wish: Wish, made: Callable[[], None]) -> Made:
    if wish.argument:
        raise UsageError(f"--heads parametric:{wish.argument}: parametric heads take no argument")
    make_heads(
        folder,
        count=wish.count,
        seed=wish.seed,
        expressions=wish.sampled_expressions,
        progress=lambda _: made(),
        keep=wish.keep,
        workers=wish.workers,
    )
    sampled = (expression_name(number) for number in range(1, wish.sampled_expressions + 1))
    return Made(tuple(head_name(wish.seed, k) for k in range(wish.count)), (NEUTRAL, *sampled))


MAKER = Maker(_make)
