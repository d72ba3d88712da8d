# SPDX-License-Identifier: GPL-3.0-or-later
"""A build from configuration to finished dataset: plan, prepare, render, commit, sum up."""

from __future__ import annotations

import json
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from generator import __version__
from generator.dataset.format.anchors_table import write_anchors
from generator.dataset.format.files import file_sha256, write_bytes
from generator.dataset.format.heads_table import write_heads
from generator.dataset.format.manifest import (
    MANIFEST_FILE,
    POSES_FILE,
    Manifest,
    common_configuration,
    configuration_digest,
    read_manifest,
    write_manifest,
)
from generator.dataset.format.part import PartInfo
from generator.dataset.show.card import write_card
from generator.dataset.show.pictures import anchor_sheet, contact_sheet, detection_map
from generator.errors import DatasetError, HeadError
from generator.execution.build.chunks import assign_chunks, cut, read_earlier
from generator.execution.build.extend import carry_over, earlier_parts
from generator.execution.build.folder import (
    ANCHOR_SHEET_FILE,
    FAILURES_FILE,
    MAP_FILE,
    SHEET_FILE,
    Confirm,
    ask_to_drop,
    begin,
    check_configuration,
    claim,
    drop,
    mark,
    spare_skipped,
    stale_parts,
    start_over,
)
from generator.execution.build.head_rows import head_anchors, head_row, relative
from generator.execution.build.lock import locked
from generator.execution.build.prepared_heads import PreparedHeads, lane_versions
from generator.execution.build.receipts import Receipts, split_done
from generator.execution.build.sources import find_source
from generator.execution.build.units import PlannedHead, assign_split, camera_distance, plan_units
from generator.execution.executors.executor import Executor
from generator.execution.lanes.lane import head_to_json
from generator.execution.status import LoggingReporter, Reporter
from generator.heads.head import NEUTRAL, Head, HeadSource, SkippedHead
from generator.landmarks.anchors import Anchors
from generator.placing.face import Prepared
from generator.plan.config import BuildConfig
from generator.plan.poses import PosePlan


@dataclass
class BuildResult:
    """What a build ended with."""

    root: Path
    manifest: Manifest
    skipped: list[SkippedHead]
    failed_units: int
    pictures: list[Path]
    seconds: dict[str, float] = field(default_factory=dict)
    """Lane seconds a stage, summed over all lanes, of the units built in this run."""

    @property
    def complete(self) -> bool:
        """Every head and every unit was built."""
        return not self.skipped and not self.failed_units


def build(
    config: BuildConfig,
    root: Path,
    executor: Executor,
    reporter: Reporter,
    *,
    command: str = "",
    fresh: bool = False,
    confirm: Confirm = lambda what: False,
) -> BuildResult:
    """Build, finish or extend the dataset of config in the folder root.

    Parameters
    ----------
    executor: carries out the orders; closed by the caller.
    command: the command line, recorded in the manifest.
    fresh: delete the dataset that is there first.
    confirm: asked before anything is deleted that may be missed; by default it is not.

    Raises
    ------
    UsageError: the configuration makes no sense, or no head can be built.
    DatasetError: root holds something else, another build is at work there, it
        cannot be written, or confirm said no.
    """
    root = root.absolute()
    plan = config.poses.plan()
    claim(root)
    with locked(root):
        if fresh:
            start_over(root, confirm)
        if not check_configuration(config, root):
            mark(config, root)
        with LoggingReporter(reporter, root) as logged:
            logged.log(f"headturn {__version__}: {executor.name}, {executor.workers} workers; {command}")
            return _build(config, plan, root, executor, logged, command, confirm)


def _build(
    config: BuildConfig,
    plan: PosePlan,
    root: Path,
    executor: Executor,
    reporter: Reporter,
    command: str,
    confirm: Confirm,
) -> BuildResult:
    source = find_source(config.heads, root, reporter)
    planned, skipped, versions = prepare_heads(source, config, root, executor, reporter)
    earlier = read_earlier(root / POSES_FILE)
    chunks = assign_chunks(plan, config.dataset.unit_size, earlier)
    digest = configuration_digest(common_configuration(config.as_dict()))
    orders = plan_units(
        planned,
        cut(plan, chunks, earlier),
        config,
        root=root,
        configuration_digest=digest,
        versions=versions,
    )
    receipts = Receipts(root)
    stale = stale_parts(root, orders)
    spare_skipped(stale, skipped, receipts)
    ask_to_drop([part for part in stale if part not in earlier_parts(orders)], root, confirm)
    if carried := carry_over(orders, root, receipts):
        reporter.note(f"the grid grew: {carried} parts got new indices without being rendered again")
    begin(config, plan, chunks, root)
    drop(stale, root, [(head.head.subject, head.head.expression) for head in planned], plan)
    done, todo = split_done(orders, receipts)
    if done:
        reporter.note(f"continuing: {len(done)} of {len(orders)} units are already there")

    reporter.stage("rendering", sum(len(order["poses"]) for order in todo))
    parts, failures, seconds = run_units(todo, executor, receipts, reporter)
    write_lines(root / FAILURES_FILE, failures)
    write_heads(
        [head_row(head, relative(head.head.mesh_path, source.path), config) for head in planned], root
    )
    write_anchors([head_anchors(head) for head in planned], root)
    manifest = Manifest(
        versions=versions,
        configuration=config.as_dict(),
        parts=tuple(sorted(done + parts, key=lambda part: part.path)),
        images=config.dataset.images,
        heads=len(planned),
        skipped=tuple({"head": f"{s.subject}/{s.expression}", "reason": s.reason} for s in skipped),
        failures=len(failures),
        created_by=command,
    )
    if not manifest.parts:
        raise DatasetError(f"{root}: no unit could be built; the reasons are in {root / FAILURES_FILE}")
    write_card(manifest, root)
    pictures = []
    if config.dataset.images != "none":
        pictures.append(contact_sheet(root, manifest, root / SHEET_FILE))
        pictures.append(anchor_sheet(root, manifest, root / ANCHOR_SHEET_FILE))
    pictures.append(detection_map(root, manifest, root / MAP_FILE))
    write_manifest(manifest, root)
    return BuildResult(root, manifest, skipped, len(failures), pictures, seconds)


def prepare_heads(
    source: HeadSource, config: BuildConfig, root: Path, executor: Executor, reporter: Reporter
) -> tuple[list[PlannedHead], list[SkippedHead], dict[str, str]]:
    """Check every head and find every subject's face. Bad heads are skipped with their reason.

    Returns (heads to build, heads skipped, versions). Raises UsageError if none is left.
    """
    subjects: dict[str, list[Head]] = defaultdict(list)
    for head in source.heads:
        subjects[head.subject].append(head)
    skipped = list(source.skipped)
    for missing in skipped:
        reporter.note(f"skipped {missing.subject}/{missing.expression}: {missing.reason}")

    orders = []
    for heads in subjects.values():
        # Pose zero is the neutral face's; an open mouth would move the centre.
        heads.sort(key=lambda head: (head.expression != NEUTRAL, head.expression))
        jobs = [head_to_json(head) for head in heads]
        orders.append({"op": "prepare", "heads": jobs, "frame": config.poses.frame})
    reporter.stage("preparing heads", len(orders))
    planned: list[PlannedHead] = []
    versions = lane_versions(executor)
    hashes = {str(file.absolute()): file_hash(file) for head in source.heads for file in head.files}
    for outcome in PreparedHeads(root, versions, hashes).outcomes(orders, executor):
        reporter.advance()
        heads = subjects[outcome.order["heads"][0]["subject"]]
        receipt = outcome.receipt
        facts = receipt["facts"] if receipt else [{"error": outcome.error}] * len(heads)
        for head, fact in zip(heads, facts, strict=True):
            if receipt is None or "error" in fact:
                skipped.append(SkippedHead(head.subject, head.expression, head.mesh_path, fact["error"]))
                reporter.note(f"skipped {head.name}: {fact['error']}")
                continue
            prepared = Prepared.from_dict(receipt["prepared"])
            planned.append(
                PlannedHead(
                    head=head,
                    prepared=prepared,
                    file_sha256=tuple(
                        (relative(file, source.path), hashes[str(file.absolute())]) for file in head.files
                    ),
                    vertices=fact["vertices"],
                    triangles=fact["triangles"],
                    split=assign_split(head.subject, config.dataset.validation),
                    distance_mm=camera_distance(config, prepared),
                    anchors=Anchors.from_dict(fact["anchors"]),
                    problems=tuple(fact["problems"]),
                )
            )
        if receipt:
            for text in receipt["prepared"]["notes"]:
                reporter.note(f"{heads[0].subject}: {text}")
    if not planned:
        reason = f"; the first: {skipped[0].reason}" if skipped else ""
        raise HeadError(f"{source.path}: none of its heads can be built{reason}")
    planned.sort(key=lambda head: (head.head.subject, head.head.expression))
    return planned, skipped, versions


def file_hash(file: Path) -> str:
    """SHA-256 of a file; "" if it cannot be read, which preparing its head will say."""
    try:
        return file_sha256(file)
    except OSError:
        return ""


def run_units(
    orders: list[dict[str, Any]], executor: Executor, receipts: Receipts, reporter: Reporter
) -> tuple[list[PartInfo], list[dict[str, Any]], dict[str, float]]:
    """Carry out build orders. Returns (parts, failures, lane seconds a stage)."""
    parts: list[PartInfo] = []
    failures: list[dict[str, Any]] = []
    seconds: dict[str, float] = defaultdict(float)
    for outcome in executor.run(orders, reporter.advance):
        head = outcome.order["head"]
        facts = {
            "unit": outcome.order["unit"],
            "subject": head["subject"],
            "expression": head["expression"],
            "poses": len(outcome.order["poses"]),
            "attempts": outcome.attempts,
        }
        if outcome.receipt is None:
            failures.append({**facts, "reason": outcome.error, "log": outcome.log.splitlines()})
            reporter.event("quarantined", {**facts, "reason": outcome.error})
            reporter.note(
                f"gave up unit {facts['unit']} of {head['subject']}/{head['expression']}: {outcome.error}"
            )
            continue
        part = PartInfo(**outcome.receipt["part"])
        receipts.add(part)
        parts.append(part)
        spent = {stage: round(value, 3) for stage, value in outcome.receipt["seconds"].items()}
        reporter.event("unit", {**facts, "detected": part.detected, "seconds": spent})
        for stage, value in spent.items():
            seconds[stage] += value
    return parts, failures, dict(seconds)


def is_finished(config: BuildConfig, root: Path) -> bool:
    """True if root holds the finished dataset of this very configuration, with nothing left out."""
    if not (root / MANIFEST_FILE).is_file():
        return False
    manifest = read_manifest(root)
    same = configuration_digest(manifest.configuration) == configuration_digest(config.as_dict())
    return same and not manifest.failures and not manifest.skipped


def write_lines(path: Path, records: list[dict[str, Any]]) -> None:
    """Write JSON lines, or remove the file when there is nothing to say."""
    if records:
        write_bytes(path, "".join(json.dumps(record) + "\n" for record in records).encode())
    else:
        path.unlink(missing_ok=True)
