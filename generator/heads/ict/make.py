# SPDX-License-Identifier: GPL-3.0-or-later
"""Make folders of heads from the user's own copy of ICT-FaceKit."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path

import numpy as np

from generator.heads.head import NEUTRAL, Made, Maker, Wish
from generator.heads.ict.atlas import ict_surface
from generator.heads.ict.folder import MATERIAL_FILE, topology, write_materials
from generator.heads.ict.mesh import LEFT_OUT
from generator.heads.ict.paint import paint_lashes, paint_teeth
from generator.heads.ict.shape import (
    MM_PER_CM,
    expression_modes,
    head_shape,
    head_vertices,
    sample_weights,
)
from generator.heads.ict.source import find_folder, read_facekit
from generator.heads.made import (
    check_numbers,
    expression_name,
    make_folders,
    prepare_folder,
    whole_folder,
    write_card,
)
from generator.heads.obj_write import write_obj
from generator.heads.parametric.appearance import sample_appearance
from generator.heads.parametric.curtain import paint_curtain
from generator.heads.parametric.expression import expressions_of
from generator.heads.parametric.eyes import paint_eye
from generator.heads.parametric.folder import write_texture
from generator.heads.parametric.identity import sample_identity
from generator.heads.parametric.skin import paint_skin
from generator.heads.parametric.source import data_folder

LICENSE = "MIT"
ATTRIBUTION = "ICT-FaceKit, USC Institute for Creative Technologies"

_HEAD_NAME = re.compile(r"ict-s\d+p\d{4,}")


def make_ict_heads(
    out: Path,
    source: str,
    *,
    count: int,
    seed: int,
    expressions: int = 0,
    progress: Callable[[str], None] | None = None,
    keep: bool = False,
    workers: int | None = None,
) -> list[Path]:
    """Write heads ``ict-s<seed>p0000`` ... below out and return their folders.

    source: the folder of ICT-FaceKit, or of a light copy; see :mod:`generator.heads.ict.source`. All else is
    as in :func:`generator.heads.parametric.make.make_heads`.

    Raises
    ------
    UsageError: a number is out of range, source is no such folder, or out holds something else.
    HeadError: a file of source is missing or not what it should be, MakeHuman's data are not installed, a
        file cannot be written, or a process was killed.
    """
    check_numbers(count, seed, expressions)
    place = find_folder(source)
    data_folder()
    _prepare_process(place)
    prepare_folder(out, _HEAD_NAME, "a head of ICT-FaceKit")
    folders = [out / head_name(seed, index) for index in range(count)]
    make_folders(
        folders,
        expression_name(expressions) if expressions else NEUTRAL,
        partial(_make_head, out, place, seed, expressions),
        partial(_prepare_process, place),
        keep=keep,
        progress=progress,
        workers=workers,
    )
    return folders


def _prepare_process(place: Path) -> None:
    ict_surface(place)


def head_name(seed: int, index: int) -> str:
    """Subject, and name of the folder, of head ``index`` of a seed."""
    return f"ict-s{seed}p{index:04d}"


def _make_head(out: Path, place: Path, seed: int, expressions: int, index: int) -> str:
    name = head_name(seed, index)
    with whole_folder(out / name) as work:
        _fill(work, name, place, seed, index, expressions)
    return name


def _fill(work: Path, subject: str, place: Path, seed: int, index: int, expressions: int) -> None:
    """Write all files of a head into a folder."""
    kit, surface = read_facekit(place), ict_surface(place)
    # The modes say nothing of age, sex and ethnicity; who it is painted as is drawn as for parametric heads.
    person = sample_identity(np.random.default_rng([seed, index, 0]))
    look = sample_appearance(np.random.default_rng([seed, index, 1]), person)
    weights = sample_weights(np.random.default_rng([seed, index, 5]))
    shape = head_shape(kit, surface, weights, look, np.random.default_rng([seed, index, 2]))
    paint = np.random.default_rng([seed, index, 3])
    long_hair = shape.curtain is not None
    described = {}
    for name, expression in expressions_of(seed, index, expressions):
        vertices = head_vertices(kit, surface, shape, expression)
        write_obj(work / f"{name}.obj", MATERIAL_FILE, vertices, topology(surface, long_hair))
        modes = expression_modes(expression)
        described[name] = {"file": f"{name}.obj", **asdict(expression), "modes": modes}
    write_materials(work, long_hair)
    skin = paint_skin(surface.atlas, look, paint)
    paint_teeth(skin, surface.atlas, look)
    write_texture(work / "skin.png", skin)
    write_texture(work / "eye.png", paint_eye(look, paint))
    write_texture(work / "lash.png", paint_lashes(look, paint))
    if long_hair:
        write_texture(work / "hair.png", paint_curtain(look, paint))
    write_card(
        work,
        {
            "source": "ict",
            "subject": subject,
            "license": LICENSE,
            "redistributable": True,
            "attribution": ATTRIBUTION,
            "units": "mm",
            "up": "+Y",
            "forward": "+Z",
            "expressions": described,
            "left_out": list(LEFT_OUT),
            "parameters": {
                "seed": seed,
                "index": index,
                "scale_mm_per_cm": MM_PER_CM,
                "identity": [float(weight) for weight in weights],
                "painted_as": {
                    "gender": person.gender,
                    "age_years": person.age_years,
                    "ethnicity": person.ethnicity,
                },
                "appearance": asdict(look),
            },
        },
    )


def _make(folder: Path, wish: Wish, made: Callable[[], None]) -> Made:
    make_ict_heads(
        folder,
        wish.argument,
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
