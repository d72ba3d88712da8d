# SPDX-License-Identifier: GPL-3.0-or-later
"""A build from configuration to finished dataset: plan, prepare, render, commit, sum up."""

from __future__ import annotations

import json
import os
from collections import defaultdict
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

from generator.dataset.card import write_card
from generator.dataset.files import file_sha256, write_bytes
from generator.dataset.heads_table import HeadRow, write_heads
from generator.dataset.manifest import (
    MANIFEST_FILE,
    Manifest,
    configuration_digest,
    read_manifest,
    write_manifest,
)
from generator.dataset.part import PartInfo, check_part
from generator.dataset.pictures import contact_sheet, detection_map
from generator.errors import DatasetError, HeadError, UsageError
from generator.execution.executor import Executor
from generator.execution.lane import head_to_json
from generator.execution.prepare import Prepared
from generator.execution.units import PlannedHead, assign_split, camera_distance, plan_units
from generator.heads.head import NEUTRAL, Head, HeadSource, SkippedHead
from generator.heads.parametric.make import make_heads
from generator.heads.source import find_heads
from generator.plan.config import PARAMETRIC, BuildConfig, Heads, differences, load_config, save_config
from generator.plan.poses import PosePlan, write_poses_csv

CONFIG_FILE, POSES_FILE, FAILURES_FILE = "config.toml", "poses.csv", "failures.jsonl"
MADE_HEADS = "heads"


class Reporter(Protocol):
    """Where a build says what it is doing."""

    def stage(self, name: str, total: int) -> None:
        """A stage begins; total steps follow."""

    def advance(self, steps: int = 1) -> None:
        """Steps of the current stage are done. May be called from any thread."""

    def note(self, text: str) -> None:
        """One line that should be read."""


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
) -> BuildResult:
    """Build, or finish, the dataset of config in the folder root.

    Parameters
    ----------
    executor: carries out the orders; closed by the caller.
    command: the command line, recorded in the manifest.

    Raises
    ------
    UsageError: the configuration makes no sense, or no head can be built.
    DatasetError: root holds something else, or cannot be written.
    """
    plan = config.poses.plan()
    open_dataset(config, plan, root)
    source = find_source(config.heads, root, reporter)
    planned, skipped, versions = prepare_heads(source, config, executor, reporter)
    digest = configuration_digest(config.as_dict())
    orders = plan_units(planned, plan, config, root=root, configuration_digest=digest, versions=versions)
    done, todo = split_done(orders, root)
    if done:
        reporter.note(f"continuing: {len(done)} of {len(orders)} units are already there")

    reporter.stage("rendering", sum(len(order["poses"]) for order in todo))
    parts, failures, seconds = run_units(todo, executor, reporter)
    write_lines(root / FAILURES_FILE, failures)
    write_heads([_head_row(head, source, config) for head in planned], root)
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
        pictures.append(contact_sheet(root, manifest, root / "contact_sheet.png"))
    pictures.append(detection_map(root, manifest, root / "detection_rate.png"))
    write_manifest(manifest, root)
    return BuildResult(root, manifest, skipped, len(failures), pictures, seconds)


def open_dataset(config: BuildConfig, plan: PosePlan, root: Path) -> None:
    """Make root this configuration's dataset folder, or refuse it.

    Raises DatasetError if root holds anything else, with what differs.
    """
    mark = root / CONFIG_FILE
    try:
        if mark.is_file():
            changed = differences(config, load_config(mark, {}))
            if changed:
                raise DatasetError(
                    f"{root} already holds a dataset of another configuration ({'; '.join(changed)}); "
                    "choose another --out, or delete that folder"
                )
        elif root.exists() and (not root.is_dir() or any(root.iterdir())):
            raise DatasetError(f"{root} is not empty and not a Headturn dataset; choose another --out")
        (root / "data").mkdir(parents=True, exist_ok=True)
        save_config(config, mark)
        write_poses_csv(plan, root / POSES_FILE)
        # From here on the dataset is unfinished until a new manifest says otherwise.
        (root / MANIFEST_FILE).unlink(missing_ok=True)
    except OSError as error:
        raise DatasetError(f"{root}: cannot write there ({error.strerror}); choose another --out") from error


def find_source(heads: Heads, root: Path, reporter: Reporter) -> HeadSource:
    """The heads the configuration names; parametric ones are made in root/heads first.

    Raises UsageError if there is none, or a chosen subject does not exist.
    """
    if heads.source == PARAMETRIC:
        folder = root / MADE_HEADS
        if not folder.exists():
            reporter.stage("making heads", heads.count)
            make_heads(
                folder,
                count=heads.count,
                seed=heads.seed,
                expressions=heads.sampled_expressions,
                progress=lambda _: reporter.advance(),
            )
        path = folder
    else:
        path = Path(heads.source)
    source = find_heads(
        path,
        expressions=heads.expressions,
        license=heads.license,
        redistributable=heads.redistributable,
        units=heads.units,
        up=heads.up,
        forward=heads.forward,
    )
    if heads.subjects is not None:
        known = {head.subject for head in source.heads} | {head.subject for head in source.skipped}
        if unknown := [name for name in heads.subjects if name not in known]:
            raise UsageError(f"{path}: no subject {unknown[0]!r}; `headturn heads list {path}` shows them")
        source = HeadSource(
            source.path,
            source.kind,
            tuple(h for h in source.heads if h.subject in heads.subjects),
            tuple(s for s in source.skipped if s.subject in heads.subjects),
        )
    return source


def prepare_heads(
    source: HeadSource, config: BuildConfig, executor: Executor, reporter: Reporter
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
        orders.append({"op": "prepare", "heads": [head_to_json(head) for head in heads]})
    reporter.stage("preparing heads", len(orders))
    planned: list[PlannedHead] = []
    versions: dict[str, str] = {}
    for outcome in executor.run(orders, lambda: None):
        reporter.advance()
        heads = subjects[outcome.order["heads"][0]["subject"]]
        receipt = outcome.receipt
        facts = receipt["facts"] if receipt else [{"error": outcome.error}] * len(heads)
        for head, fact in zip(heads, facts, strict=True):
            if receipt is None or "error" in fact:
                skipped.append(SkippedHead(head.subject, head.expression, head.mesh_path, fact["error"]))
                reporter.note(f"skipped {head.name}: {fact['error']}")
                continue
            versions = receipt["versions"]
            prepared = Prepared.from_dict(receipt["prepared"])
            planned.append(
                PlannedHead(
                    head=head,
                    prepared=prepared,
                    file_sha256=tuple((_relative(f, source.path), file_sha256(f)) for f in head.files),
                    vertices=fact["vertices"],
                    triangles=fact["triangles"],
                    split=assign_split(head.subject, config.dataset.validation),
                    distance_mm=camera_distance(config, prepared),
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


def split_done(orders: list[dict[str, Any]], root: Path) -> tuple[list[PartInfo], list[dict[str, Any]]]:
    """Parts that are already there and whole, and the orders still to be carried out.

    A part under a unit's name that cannot be read is removed and built again.
    """
    done, todo = [], []
    for order in orders:
        path = root / "data" / order["split"] / f"part-{order['unit']}.parquet"
        if path.is_file():
            try:
                part = check_part(path)
            except DatasetError:
                part = None
            if part is not None and part.rows == len(order["poses"]):
                done.append(part)
                continue
            path.unlink()
        todo.append(order)
    return done, todo


def run_units(
    orders: list[dict[str, Any]], executor: Executor, reporter: Reporter
) -> tuple[list[PartInfo], list[dict[str, Any]], dict[str, float]]:
    """Carry out build orders. Returns (parts, failures, lane seconds a stage)."""
    parts: list[PartInfo] = []
    failures: list[dict[str, Any]] = []
    seconds: dict[str, float] = defaultdict(float)
    for outcome in executor.run(orders, reporter.advance):
        if outcome.receipt is None:
            head = outcome.order["head"]
            failure = {
                "unit": outcome.order["unit"],
                "subject": head["subject"],
                "expression": head["expression"],
                "poses": len(outcome.order["poses"]),
                "attempts": outcome.attempts,
                "reason": outcome.error,
            }
            failures.append(failure)
            reporter.note(
                f"unit {failure['unit']} of {head['subject']}/{head['expression']}: {outcome.error}"
            )
            continue
        parts.append(PartInfo(**outcome.receipt["part"]))
        for stage, spent in outcome.receipt["seconds"].items():
            seconds[stage] += spent
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


def _head_row(planned: PlannedHead, source: HeadSource, config: BuildConfig) -> HeadRow:
    head, prepared = planned.head, planned.prepared
    return HeadRow(
        subject=head.subject,
        expression=head.expression,
        source=head.source,
        mesh_path=_relative(head.mesh_path, source.path),
        file_sha256=planned.file_sha256,
        license=head.license,
        redistributable=head.redistributable,
        attribution=head.attribution,
        units=prepared.units,
        mm_per_unit=prepared.mm_per_unit,
        up=prepared.up,
        forward=prepared.forward,
        pivot=prepared.pivot,
        radius_mm=prepared.radius_mm,
        distance_mm=planned.distance_mm,
        lens_mm=config.render.lens_mm,
        vertices=planned.vertices,
        triangles=planned.triangles,
        split=planned.split,
        problems=(*head.problems, *planned.problems, *prepared.notes),
    )


def _relative(path: Path, root: Path) -> str:
    return Path(os.path.relpath(path, root if root.is_dir() else root.parent)).as_posix()
