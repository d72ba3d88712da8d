# SPDX-License-Identifier: GPL-3.0-or-later
"""A build from configuration to finished dataset: plan, place, render, commit, sum up."""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, cast

from generator import __version__, registries
from generator.dataset.format.anchors_table import write_anchors
from generator.dataset.format.columns import ImageMode
from generator.dataset.format.files import unsynced, write_bytes
from generator.dataset.format.heads_table import write_heads
from generator.dataset.format.manifest import (
    FAILURES_FILE,
    MANIFEST_FILE,
    Manifest,
    configuration_digest,
    read_manifest,
    write_manifest,
)
from generator.dataset.format.part_info import PartInfo
from generator.dataset.show.card import write_card
from generator.dataset.show.pictures import anchor_sheet, contact_sheet, detection_map
from generator.errors import DatasetError
from generator.execution.build.chunks import chunk_poses
from generator.execution.build.extend import carry_over, check_schema_of_parts, earlier_parts
from generator.execution.build.folder import (
    ANCHOR_SHEET_FILE,
    MAP_FILE,
    SHEET_FILE,
    Confirm,
    as_begun,
    ask_to_drop,
    begin,
    check_configuration,
    claim,
    drop,
    mark,
    spare_skipped,
    stale_parts,
    start_over,
    write_poses,
)
from generator.execution.build.head_rows import changed_files, head_anchors, head_row, relative
from generator.execution.build.lock import Lock, locked
from generator.execution.build.place import place_heads
from generator.execution.build.placed_heads import lane_versions
from generator.execution.build.receipts import Receipts, split_done
from generator.execution.build.sources import find_source
from generator.execution.build.units import plan_units
from generator.execution.executors.executor import Executor
from generator.execution.status import LoggingReporter, Reporter
from generator.heads.head import SkippedHead
from generator.landmarks.detector import check_detectors
from generator.messages import BuildOrder, Built, expect
from generator.picture.settled import settled
from generator.plan.config import BuildConfig, differences, recorded_config
from generator.plan.first_settings import common_values
from generator.plan.pose_plans import POSES_FILE, plan_poses, read_pose_plans, shared_plan
from generator.plan.twins import twin_factors
from generator.words import plural
from generator.worn.things import check_things


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
    # What makes no sense is said before a folder is made.
    shared_plan(config)
    twin_factors(config)
    config = settled(config)
    check_things(config)
    check_detectors(config.landmarks)
    claim(root)
    with locked(root) as lock:
        if fresh:
            start_over(root, confirm)
        config, continued = as_begun(config, root)
        if not check_configuration(config, root):
            mark(config, root)
        with LoggingReporter(reporter, root) as logged:
            logged.log(f"headturn {__version__}: {executor.name}, {executor.workers} workers; {command}")
            if continued:
                logged.note("every head gets the same poses, as this dataset was begun")
            if lock.note:
                logged.note(lock.note)
            if reason := unsynced(root):
                logged.note(f"{root}: a power cut may cost the newest files there ({reason}); run again then")
            try:
                return _build(config, root, executor, logged, command, confirm, lock)
            except (DatasetError, OSError):
                lock.check()  # a folder that is gone is the reason, whatever failed first
                raise


def _build(
    config: BuildConfig,
    root: Path,
    executor: Executor,
    reporter: Reporter,
    command: str,
    confirm: Confirm,
    lock: Lock,
) -> BuildResult:
    source = find_source(config, root, reporter, executor.workers)
    versions = lane_versions(executor, config.detecting)
    check_schema_of_parts(root)
    planned, skipped = place_heads(source, config, versions, root, executor, reporter)
    lock.check()
    heads = [(head.head.subject, head.head.expression) for head in planned]
    earlier = read_pose_plans(root / POSES_FILE) if (root / POSES_FILE).exists() else None
    poses = chunk_poses(plan_poses(config, heads), config.dataset.unit_size, earlier)
    recorded = config.moved_to(root)
    orders = plan_units(
        planned,
        poses,
        config,
        root=root,
        # As it is recorded: relative paths count from the dataset there.
        configuration_digest=configuration_digest(common_values(recorded.as_dict())),
        versions=versions,
    )
    receipts = Receipts(root)
    stale = stale_parts(root, orders)
    spare_skipped(stale, skipped, receipts)
    gone = [part for part in stale if part not in earlier_parts(orders)]
    ask_to_drop(gone, root, confirm, changed_files(planned, root) if gone else ())
    if carried := carry_over(orders, root, receipts):
        reporter.note(f"{plural(carried, 'part')} taken over without being rendered again")
    begin(config, root)
    drop(stale, root, heads, poses.plans, orders)
    write_poses(poses.plans, root)
    done, todo = split_done(orders, receipts)
    for reason in receipts.refused.values():
        reporter.note(f"rendered again: {reason}")
    if done:
        reporter.note(f"continuing: {len(done)} of {len(orders)} units are already there")

    reporter.stage("rendering", sum(len(order.views) for order in todo))
    built, failures, seconds = run_units(todo, executor, receipts, reporter, lock.check)
    parts = sorted(done + built, key=lambda part: part.path)
    write_lines(root / FAILURES_FILE, failures)
    topology = registries.DETECTORS.get(config.landmarks.detector).topology
    write_heads(
        [head_row(head, relative(head.head.mesh_path, source.path), topology) for head in planned], root
    )
    write_anchors([head_anchors(head) for head in planned], root)
    manifest = Manifest(
        versions=versions,
        configuration=recorded.as_dict(),
        parts=tuple(part for part in parts if not part.of_twins),
        twins=tuple(part for part in parts if part.of_twins),
        images=cast(ImageMode, config.dataset.images),
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
    lock.check()
    write_manifest(manifest, root)
    return BuildResult(root, manifest, skipped, len(failures), pictures, seconds)


def run_units(
    orders: Sequence[BuildOrder],
    executor: Executor,
    receipts: Receipts,
    reporter: Reporter,
    check: Callable[[], None] = lambda: None,
) -> tuple[list[PartInfo], list[dict[str, Any]], dict[str, float]]:
    """Carry out build orders. Returns (parts, failures, lane seconds a stage).

    check: is called after each; raises what ends the build.
    """
    parts: list[PartInfo] = []
    failures: list[dict[str, Any]] = []
    seconds: dict[str, float] = defaultdict(float)
    for outcome in executor.run(orders, reporter.advance):
        check()
        order = expect(BuildOrder, outcome.order)
        facts = {
            "unit": order.unit,
            "subject": order.head.subject,
            "expression": order.head.expression,
            "poses": len(order.views),
            **({"factor": order.factor} if order.factor else {}),
            "attempts": outcome.attempts,
        }
        if outcome.receipt is None:
            failures.append({**facts, "reason": outcome.error, "log": outcome.log.splitlines()})
            reporter.event("quarantined", {**facts, "reason": outcome.error})
            reporter.note(f"gave up unit {order.unit} of {order.head.name}: {outcome.error}")
            continue
        built = expect(Built, outcome.receipt)
        part = built.part
        receipts.add(part, order)
        parts.append(part)
        spent = {stage: round(value, 3) for stage, value in built.seconds.items()}
        reporter.event("unit", {**facts, "detected": part.detected, "seconds": spent})
        for stage, value in spent.items():
            seconds[stage] += value
    return parts, failures, dict(seconds)


def is_finished(config: BuildConfig, root: Path) -> bool:
    """True if root holds the finished dataset of this very configuration, with nothing left out."""
    if not (root / MANIFEST_FILE).is_file():
        return False
    manifest = read_manifest(root)
    same = not differences(settled(config), recorded_config(manifest.configuration, root))
    return same and not manifest.failures and not manifest.skipped


def write_lines(path: Path, records: list[dict[str, Any]]) -> None:
    """Write JSON lines, or remove the file when there is nothing to say."""
    if records:
        write_bytes(path, "".join(json.dumps(record) + "\n" for record in records).encode())
    else:
        path.unlink(missing_ok=True)
