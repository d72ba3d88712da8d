# SPDX-License-Identifier: GPL-3.0-or-later
"""The heads of a build: found on disk, or made on the spot."""

from __future__ import annotations

from pathlib import Path

from generator import registries
from generator.errors import UsageError
from generator.execution.build.folder import MADE_HEADS
from generator.execution.status import Progress
from generator.heads.head import SCENE, HeadSource, Made, Maker, Wish
from generator.heads.source import find_heads
from generator.plan.config import BuildConfig
from generator.plan.head_source import split_path
from generator.plan.scenes import check_of_scenes


def find_source(
    config: BuildConfig, root: Path, reporter: Progress, workers: int | None = None
) -> HeadSource:
    """The heads the configuration names; those made on the spot are made in root/heads first,
    by as many processes as workers says; None for one a core.

    Raises UsageError if there is none, or a chosen subject does not exist.
    """
    heads = config.heads
    subjects, expressions = heads.subjects, heads.expressions
    path = source_path(config, root)
    if config.makes_heads:
        made = _make(config, path, reporter, workers)
        # The folder may hold more than are asked for now.
        subjects, expressions = subjects or made.subjects, expressions or made.expressions
    source = find_heads(
        path,
        expressions=expressions,
        license=heads.license,
        redistributable=heads.redistributable,
        units=heads.units,
        up=heads.up,
        forward=heads.forward,
        eye_distance_mm=heads.eye_distance_mm,
        without=heads.without,
        head_object=heads.head_object,
    )
    check_of_scenes(config, any(head.source == SCENE for head in source.heads))
    if subjects is None:
        return source
    known = {head.subject for head in source.heads} | {head.subject for head in source.skipped}
    if unknown := [name for name in subjects if name not in known]:
        raise UsageError(f"{path}: no subject {unknown[0]!r}; `headturn heads list {path}` shows them")
    return HeadSource(
        source.path,
        source.kind,
        tuple(h for h in source.heads if h.subject in subjects),
        tuple(s for s in source.skipped if s.subject in subjects),
    )


def source_path(config: BuildConfig, root: Path) -> Path:
    """Where the heads of a dataset in the folder root lie."""
    return root / MADE_HEADS if config.makes_heads else config.located(config.heads.source)


def _make(config: BuildConfig, path: Path, reporter: Progress, workers: int | None) -> Made:
    heads = config.heads
    name, _, argument = heads.source.partition(":")
    if path_named := split_path(heads.source)[1]:
        argument = str(config.located(path_named))
    maker: Maker = registries.HEAD_MAKERS.get(name)
    reporter.stage("making heads", heads.count)
    wish = Wish(argument, heads.count, heads.seed, heads.sampled_expressions, workers)
    return maker.make(path, wish, reporter.advance)
