# SPDX-License-Identifier: GPL-3.0-or-later
"""The heads of a build: checked, and placed by the lanes."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from pathlib import Path

from generator.dataset.format.files import file_sha256
from generator.errors import HeadError
from generator.execution.build.head_rows import relative
from generator.execution.build.placed_heads import PlacedHeads
from generator.execution.build.shared_heads import find_shared
from generator.execution.build.units import PlannedHead, assign_split, head_camera
from generator.execution.executors.executor import Executor
from generator.execution.status import Reporter
from generator.heads.head import NEUTRAL, Head, HeadSource, SkippedHead
from generator.messages import HeadFacts, Placed, PlaceOrder, expect
from generator.plan.config import BuildConfig


def place_heads(
    source: HeadSource,
    config: BuildConfig,
    versions: dict[str, str],
    root: Path,
    executor: Executor,
    reporter: Reporter,
) -> tuple[list[PlannedHead], list[SkippedHead]]:
    """Check every head and find every subject's face. Bad heads are skipped with their reason.

    versions: of the lanes. Returns (heads to build, heads skipped). Raises HeadError if none is left.
    """
    skipped = list(source.skipped)
    for missing in skipped:
        reporter.note(f"skipped {missing.subject}/{missing.expression}: {missing.reason}")
    files = dict.fromkeys(file for head in source.heads for file in head.files)
    hashes = {str(file): file_hash(file) for file in files}
    kept = PlacedHeads(root, versions, hashes)
    orders = place_orders(source, config)
    if config.poses.frame == "canonical":
        reporter.note(
            "pose zero is that of earlier releases, which detectors read 5 degrees low; see --frame"
        )
    shared = find_shared(orders, kept, executor, reporter)
    orders = [replace(order, shared=shared) for order in orders]
    reporter.stage("placing heads", len(orders))
    planned: list[PlannedHead] = []
    known: dict[str, list[str]] = {}
    for outcome in kept.outcomes(orders, executor):
        reporter.advance()
        heads = expect(PlaceOrder, outcome.order).heads
        placed = None if outcome.receipt is None else expect(Placed, outcome.receipt)
        facts = placed.facts if placed else (HeadFacts(error=outcome.error),) * len(heads)
        for head, fact in zip(heads, facts, strict=True):
            if placed is None or fact.anchors is None:
                skipped.append(SkippedHead(head.subject, head.expression, head.mesh_path, fact.error))
                reporter.note(f"skipped {head.name}: {fact.error}")
                continue
            for text in dict.fromkeys((*head.problems, *fact.problems)):
                known.setdefault(text, []).append(head.name)
            planned.append(
                PlannedHead(
                    head=head,
                    placement=placed.placement,
                    file_sha256=tuple(
                        (relative(file, source.path), hashes[str(file)]) for file in head.files
                    ),
                    vertices=fact.vertices,
                    triangles=fact.triangles,
                    split=assign_split(head.subject, config.dataset.validation),
                    camera=head_camera(config, placed.placement),
                    anchors=fact.anchors,
                    problems=fact.problems,
                )
            )
        if placed:
            for text in placed.placement.notes:
                reporter.note(f"{heads[0].subject}: {text}")
    for text, names in known.items():
        more = f" and {len(names) - 1} more" if len(names) > 1 else ""
        reporter.note(f"{names[0]}{more}: {text}")
    if not planned:
        reason = f"; the first: {skipped[0].reason}" if skipped else ""
        raise HeadError(f"{source.path}: none of its heads can be built{reason}")
    planned.sort(key=lambda head: (head.head.subject, head.head.expression))
    return planned, skipped


def place_orders(source: HeadSource, config: BuildConfig) -> list[PlaceOrder]:
    """An order a subject."""
    subjects: dict[str, list[Head]] = defaultdict(list)
    for head in source.heads:
        subjects[head.subject].append(head)
    return [
        PlaceOrder(tuple(in_placing_order(heads)), config.poses.frame, config.detecting)
        for heads in subjects.values()
    ]


def in_placing_order(heads: list[Head]) -> list[Head]:
    """Pose zero is the neutral face's: an open mouth would move the centre."""
    return sorted(heads, key=lambda head: (head.expression != NEUTRAL, head.expression))


def file_hash(file: Path) -> str:
    """SHA-256 of a file; "" if it cannot be read, which placing its head will say."""
    try:
        return file_sha256(file)
    except OSError:
        return ""
