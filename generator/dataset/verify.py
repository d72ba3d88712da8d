# SPDX-License-Identifier: GPL-3.0-or-later
"""Proof that a dataset is complete, unchanged and consistent with itself."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from generator.dataset.anchors_table import ANCHORS_FILE, HeadAnchors, read_anchors
from generator.dataset.detection import Cell, DetectionTally
from generator.dataset.digest import add_digests, content_digest
from generator.dataset.exact_checks import anchor_problems, exact_problems
from generator.dataset.files import file_sha256
from generator.dataset.heads_table import HEADS_FILE, HeadRow, read_heads
from generator.dataset.manifest import (
    POSES_FILE,
    Manifest,
    common_configuration,
    configuration_digest,
    read_manifest,
)
from generator.dataset.open import as_array
from generator.dataset.part import PartInfo, iter_part, part_schema_of
from generator.dataset.pass_checks import pass_problems
from generator.dataset.row_checks import (
    camera_problems,
    identity_problems,
    image_problems,
    landmark_problems,
    rotation_problems,
)
from generator.dataset.schema import LANDMARK_TOPOLOGY, LANDMARKS, SCHEMA_VERSION, part_schema
from generator.errors import DatasetError, HeadturnError
from generator.plan.poses import PosePlan, csv_plan, pose_name

SHOWN = 3
"""How many of the same problem are named; the rest are counted."""

WORST = 5

NOT_CHECKED = "not checked, because of the problems above"

CHECKS = (
    "manifest",
    "heads and poses",
    "part files",
    "part hashes",
    "schema",
    "no nulls",
    "every row once",
    "identity",
    "rotation",
    "camera",
    "landmarks",
    "anchors",
    "exact landmarks",
    "images",
    "passes",
    "digest",
)


@dataclass
class Check:
    """One thing that was proved or refuted. problems holds the first few of count."""

    name: str
    problems: list[str] = field(default_factory=list)
    count: int = 0
    done: bool = False

    @property
    def ok(self) -> bool:
        """Was it checked, and is it so?"""
        return self.done and not self.count

    @property
    def detail(self) -> str:
        """One line: what is wrong, the first few named; "" if nothing is."""
        if self.count:
            more = f" and {self.count - len(self.problems)} more" if self.count > len(self.problems) else ""
            return "; ".join(self.problems) + more
        return "" if self.done else NOT_CHECKED

    def add(self, problems: Iterable[str]) -> None:
        """Count problems and keep the first few."""
        for problem in problems:
            self.count += 1
            if len(self.problems) < SHOWN:
                self.problems.append(problem)


@dataclass(frozen=True)
class VerifyReport:
    """What was checked and what was counted. Rates are shares of 1; NaN without rows.

    closure_deg: the largest angle between R_C and the rigid fit of landmarks_exact.
    """

    checks: tuple[Check, ...]
    heads: int = 0
    poses: int = 0
    rows: int = 0
    detected_rows: int = 0
    detection_rate: float = float("nan")
    closure_deg: float = 0.0
    rate_by_subject: dict[str, float] = field(default_factory=dict)
    cells: tuple[Cell, ...] = ()

    @property
    def ok(self) -> bool:
        """Did every check pass?"""
        return all(check.ok for check in self.checks)

    @property
    def worst_cells(self) -> list[Cell]:
        """The cells of yaw x pitch with the lowest detection rate, worst first."""
        return sorted(self.cells, key=lambda cell: cell.rate)[:WORST]

    def text(self) -> str:
        """The report for people, a line a fact."""
        unchecked = [check.name for check in self.checks if check.detail == NOT_CHECKED]
        lines = [
            f"{'ok  ' if check.ok else 'FAIL'}  {check.name}{': ' * bool(check.detail)}{check.detail}"
            for check in self.checks
            if check.detail != NOT_CHECKED
        ]
        if unchecked:
            lines.append(f"{NOT_CHECKED}: {', '.join(unchecked)}")
        if self.rows:
            lines.append(
                f"{self.rows} rows of {self.heads} heads x {self.poses} poses; "
                f"a face was found in {self.detection_rate:.1%}"
            )
            lines.append(f"exact landmarks give R_C back to {self.closure_deg:.1g}°")
            lines += [
                f"  yaw {cell.yaw_deg:+g}, pitch {cell.pitch_deg:+g}: {cell.rate:.0%} of {cell.rows}"
                for cell in self.worst_cells
                if cell.rate < 1
            ]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "ok": self.ok,
            "checks": [{"name": c.name, "ok": c.ok, "detail": c.detail} for c in self.checks],
            "heads": self.heads,
            "poses": self.poses,
            "rows": self.rows,
            "detected_rows": self.detected_rows,
            "detection_rate": self.detection_rate if self.rows else None,
            "closure_deg": self.closure_deg,
            "rate_by_subject": self.rate_by_subject,
            "cells": [{**asdict(cell), "rate": cell.rate} for cell in self.cells],
        }


def verify_dataset(path: Path, *, progress: Callable[[int, int], None] | None = None) -> VerifyReport:
    """Check a dataset part by part, in memory that does not grow with its rows' content.

    progress: called with (parts done, parts in all).
    Never raises for what is wrong with the dataset: every problem is a line of the report.
    """
    root = Path(path)
    checks = {name: Check(name) for name in CHECKS}
    report = VerifyReport(tuple(checks.values()))
    try:
        manifest = read_manifest(root)
    except DatasetError as error:
        checks["manifest"].add([str(error)])
        return report
    checks["manifest"].done = True
    try:
        heads, plan = read_heads(root), csv_plan(root / POSES_FILE)
        anchors = read_anchors(root)
        tables = (HEADS_FILE, ANCHORS_FILE, POSES_FILE)
        changed = [name for name in tables if file_sha256(root / name) != manifest.tables.get(name)]
    except (OSError, HeadturnError) as error:
        checks["heads and poses"].add([str(error)])
        return report
    checks["heads and poses"].add(f"{name} was changed after the build (SHA-256 differs)" for name in changed)
    checks["anchors"].add(anchor_problems(heads, anchors))
    run = _Run(root, manifest, heads, plan, anchors, checks)
    for check in checks.values():
        check.done = True
    for done, part in enumerate(run.present_parts(), start=1):
        run.check_part(part)
        if progress:
            progress(done, len(manifest.parts))
    run.check_whole()
    tally = run.tally
    return VerifyReport(
        checks=report.checks,
        heads=len(heads),
        poses=len(plan),
        rows=run.rows,
        detected_rows=int(tally.detected.sum(dtype=np.int64)),
        detection_rate=tally.rate,
        closure_deg=run.closure_deg,
        rate_by_subject=tally.by_subject(),
        cells=tuple(tally.by_cell()),
    )


class _Run:
    """One pass over the parts of a dataset."""

    def __init__(
        self,
        root: Path,
        manifest: Manifest,
        heads: list[HeadRow],
        plan: PosePlan,
        anchors: dict[tuple[str, str], HeadAnchors],
        checks: dict[str, Check],
    ) -> None:
        self.root, self.manifest, self.heads, self.plan, self.checks = root, manifest, heads, plan, checks
        self.tally = DetectionTally(heads, plan)
        self.names = [pose_name(*pose) for pose in plan.angles_deg.tolist()]
        self.points = np.full((len(heads), LANDMARKS, 3), np.nan)
        for place, head in enumerate(heads):
            if found := anchors.get((head.subject, head.expression)):
                self.points[place] = found.points
        self.rows = 0
        self.closure_deg = 0.0
        self.digests: list[str] = []
        self.metadata = {
            key.encode(): value.encode()
            for key, value in (
                ("headturn.schema_version", manifest.schema_version),
                ("headturn.landmark_topology", LANDMARK_TOPOLOGY),
                ("headturn.images", manifest.images),
                (
                    "headturn.configuration_digest",
                    configuration_digest(common_configuration(manifest.configuration)),
                ),
            )
        }

    def present_parts(self) -> list[PartInfo]:
        """The listed parts that exist; missing and unlisted files become problems."""
        expected = {part.path for part in self.manifest.parts}
        folder = self.root / "data"
        found = {p.relative_to(self.root).as_posix() for p in folder.rglob("*") if not p.is_dir()}
        problems = [f"{path} is missing" for path in sorted(expected - found)]
        problems += [f"{path} is not listed in the manifest" for path in sorted(found - expected)]
        self.checks["part files"].add(problems)
        return [part for part in self.manifest.parts if part.path in found]

    def check_part(self, part: PartInfo) -> None:
        path = self.root / part.path
        hashes = self.checks["part hashes"]
        try:
            if file_sha256(path) != part.sha256:
                hashes.add([f"{part.path} was changed or damaged after the build (SHA-256 differs)"])
            schema = part_schema_of(path)
            wrong = self._schema_problems(schema)
            self.checks["schema"].add(f"{part.path}: {problem}" for problem in wrong)
            if wrong:
                return
            rows, detected, digests = 0, 0, []
            for batch in iter_part(path):
                if nulls := [name for name in batch.schema.names if _nulls(batch.column(name))]:
                    self.checks["no nulls"].add(f"{part.path}: nulls in {name}" for name in nulls)
                    continue
                rows += len(batch)
                detected += int(as_array(batch, "detected").sum())
                digests.append(content_digest(batch))
                self._check_rows(batch, part)
        except (OSError, HeadturnError, UnicodeDecodeError) as error:
            hashes.add([f"{part.path} cannot be read: {error}"])
            return
        self.rows += rows
        digest = add_digests(digests)
        self.digests.append(digest)
        if (rows, detected) != (part.rows, part.detected):
            hashes.add([f"{part.path} has {rows} rows, the manifest says {part.rows}"])
        if digest != part.digest:
            self.checks["digest"].add([f"{part.path} holds other values than the manifest says"])

    def check_whole(self) -> None:
        """What only all rows together can show: none missing, none twice."""
        seen, check = self.tally.rows, self.checks["every row once"]
        if self.manifest.failures and (seen == 0).any():
            check.add([f"{self.manifest.failures} units failed, see failures.jsonl"])
        for wrong, what in ((seen == 0, "is missing"), (seen > 1, "is there more than once")):
            for head, row in zip(self.heads, wrong, strict=True):
                poses = np.flatnonzero(row)
                check.add(f"{head.subject}/{head.expression}/{self.names[k]} {what}" for k in poses)
        if len(self.heads) != self.manifest.heads:
            self.checks["heads and poses"].add(
                [f"heads.parquet has {len(self.heads)} heads, the manifest says {self.manifest.heads}"]
            )
        if add_digests(self.digests) != self.manifest.digest:
            self.checks["digest"].add(["the digest of all rows is not the manifest's"])

    def _check_rows(self, batch: pa.RecordBatch, part: PartInfo) -> None:
        heads, poses = self.tally.add(batch)
        known = (heads >= 0) & (poses >= 0)
        if not known.all():
            unknown = batch.filter(pa.array(~known)).column("sample_id").to_pylist()
            self.checks["every row once"].add(
                f"{name} is not in heads.parquet x poses.csv" for name in unknown
            )
            batch, heads, poses = batch.filter(pa.array(known)), heads[known], poses[known]
        if not len(batch):
            return
        split = part.path.split("/")[1]
        add = self.checks
        add["identity"].add(identity_problems(batch, self.heads, self.plan, self.names, heads, poses, split))
        add["rotation"].add(rotation_problems(batch))
        add["camera"].add(camera_problems(batch, self.heads, heads))
        add["landmarks"].add(landmark_problems(batch))
        problems, closure = exact_problems(batch, self.heads, heads, self.points)
        add["exact landmarks"].add(problems)
        self.closure_deg = max(self.closure_deg, closure)
        add["images"].add(image_problems(batch, self.manifest.images, self.root))
        add["passes"].add(pass_problems(batch, self.heads, heads, self.root))

    def _schema_problems(self, schema: pa.Schema) -> list[str]:
        metadata = schema.metadata or {}
        wrong = [
            f"{key.decode()} is {metadata.get(key, b'missing').decode(errors='replace')!r}, "
            f"expected {value.decode()!r}"
            for key, value in self.metadata.items()
            if metadata.get(key) != value
        ]
        expected = part_schema(self.manifest.images, {}, "")
        if not schema.equals(expected):
            names = set(schema.names) ^ set(expected.names) or {
                field.name for field in expected if not schema.field(field.name).equals(field)
            }
            what = ", ".join(sorted(names)) or "their order"
            wrong.append(f"columns differ from schema {SCHEMA_VERSION}: {what}")
        return wrong


def _nulls(column: pa.Array) -> bool:
    if column.null_count:
        return True
    return any(_nulls(child) for child in column.flatten()) if pa.types.is_struct(column.type) else False
