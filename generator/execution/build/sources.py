# SPDX-License-Identifier: GPL-3.0-or-later
"""The heads of a build: found on disk, or made on the spot."""

from __future__ import annotations

from pathlib import Path

from generator.errors import UsageError
from generator.execution.build.folder import MADE_HEADS
from generator.execution.status import Progress
from generator.heads.head import NEUTRAL, HeadSource
from generator.heads.parametric.make import expression_name, head_name, make_heads
from generator.heads.source import find_heads
from generator.plan.config import PARAMETRIC, Heads


def find_source(heads: Heads, root: Path, reporter: Progress) -> HeadSource:
    """The heads the configuration names; parametric ones are made in root/heads first.

    Raises UsageError if there is none, or a chosen subject does not exist.
    """
    subjects, expressions = heads.subjects, heads.expressions
    path = Path(heads.source)
    if heads.source == PARAMETRIC:
        path = root / MADE_HEADS
        reporter.stage("making heads", heads.count)
        make_heads(
            path,
            count=heads.count,
            seed=heads.seed,
            expressions=heads.sampled_expressions,
            progress=lambda _: reporter.advance(),
            keep=True,
        )
        # The folder may hold more than are asked for now.
        subjects = subjects or [head_name(heads.seed, index) for index in range(heads.count)]
        sampled = [expression_name(number) for number in range(1, heads.sampled_expressions + 1)]
        expressions = expressions or [NEUTRAL, *sampled]
    source = find_heads(
        path,
        expressions=expressions,
        license=heads.license,
        redistributable=heads.redistributable,
        units=heads.units,
        up=heads.up,
        forward=heads.forward,
    )
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
