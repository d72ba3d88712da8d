# SPDX-License-Identifier: GPL-3.0-or-later
"""Proof that a dataset is complete, unchanged and consistent with itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from generator.dataset.format.anchors_table import ANCHORS_FILE, read_anchors
from generator.dataset.format.digest import add_digests
from generator.dataset.format.files import file_sha256
from generator.dataset.format.heads_table import HEADS_FILE, HeadRow, read_heads
from generator.dataset.format.manifest import POSES_FILE, Manifest, read_manifest
from generator.dataset.format.part_info import PartInfo
from generator.dataset.proof.exact_checks import anchor_problems
from generator.dataset.proof.part_checks import PartChecker, PartFindings
from generator.dataset.proof.verify_report import Check, VerifyReport
from generator.dataset.show.detection import DetectionTally
from generator.errors import DatasetError, HeadturnError
from generator.plan.poses import PosePlan, csv_plan, pose_name
from generator.process import available_cores

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

QUICK_CHECKS = ("manifest", "heads and poses", "part files", "part sizes", "schema", "rows", "anchors")

ROWS_A_WORKER = 5000
"""With fewer rows than this for each, starting another process takes longer than it saves."""

CHUNK = 8
"""Parts a process takes at a time."""


def verify_dataset(
    path: Path,
    *,
    quick: bool = False,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> VerifyReport:
    """Check a dataset part by part, in memory that does not grow with its rows' content.

    quick: only what needs no reading of rows: the tables, the parts' sizes, footers and schemas,
        and that their rows add up to heads x poses.
    workers: processes; default one a core, where there is enough to do.
    progress: called with (parts done, parts in all).
    Never raises for what is wrong with the dataset: every problem is a line of the report.

    Raises
    ------
    DatasetError: a process that was checking parts was killed.
    """
    root = Path(path)
    checks = {name: Check(name) for name in (QUICK_CHECKS if quick else CHECKS)}
    report = VerifyReport(tuple(checks.values()), quick=quick)
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
    for check in checks.values():
        check.done = True
    parts = _present_parts(root, manifest, checks["part files"])
    tally = DetectionTally(heads, plan)
    rows, closure_deg, digests = 0, 0.0, []
    checker = PartChecker(root, manifest, heads, plan, anchors)
    with _findings(root, checker, manifest, parts, quick, workers) as findings:
        for done, found in enumerate(findings, start=1):
            for name, problems in found.checks.items():
                checks[name].merge(problems)
            if found.digest is not None:
                rows += found.rows
                digests.append(found.digest)
            closure_deg = max(closure_deg, found.closure_deg)
            for places in zip(found.heads, found.poses, found.detected, strict=True):
                tally.add(*places)
            if progress:
                progress(done, len(manifest.parts))
    if len(heads) != manifest.heads:
        checks["heads and poses"].add(
            [f"heads.parquet has {len(heads)} heads, the manifest says {manifest.heads}"]
        )
    whole = replace(report, heads=len(heads), poses=len(plan), rows=rows)
    if quick:
        if rows != len(heads) * len(plan):
            checks["rows"].add([f"{rows} rows, expected {len(heads)} heads x {len(plan)} poses"])
        return replace(
            whole,
            detected_rows=manifest.detected_rows,
            detection_rate=manifest.detected_rows / manifest.rows if manifest.rows else float("nan"),
        )
    _check_every_row_once(tally, heads, plan, manifest, checks["every row once"])
    if add_digests(digests) != manifest.digest:
        checks["digest"].add(["the digest of all rows is not the manifest's"])
    return replace(
        whole,
        detected_rows=int(tally.detected.sum(dtype=np.int64)),
        detection_rate=tally.rate,
        closure_deg=closure_deg,
        rate_by_subject=tally.by_subject(),
        cells=tuple(tally.by_cell()),
    )


def _present_parts(root: Path, manifest: Manifest, check: Check) -> list[PartInfo]:
    """The listed parts that exist; missing and unlisted files become problems."""
    expected = {part.path for part in manifest.parts}
    found = {p.relative_to(root).as_posix() for p in (root / "data").rglob("*") if not p.is_dir()}
    check.add(f"{path} is missing" for path in sorted(expected - found))
    check.add(f"{path} is not listed in the manifest" for path in sorted(found - expected))
    return [part for part in manifest.parts if part.path in found]


def _check_every_row_once(
    tally: DetectionTally, heads: list[HeadRow], plan: PosePlan, manifest: Manifest, check: Check
) -> None:
    """What only all rows together can show: none missing, none twice."""
    seen = tally.rows
    if manifest.failures and (seen == 0).any():
        check.add([f"{manifest.failures} units failed, see failures.jsonl"])
    for wrong, what in ((seen == 0, "is missing"), (seen > 1, "is there more than once")):
        for place, k in np.argwhere(wrong).tolist():
            head = heads[place]
            pose = pose_name(*plan.angles_deg[k].tolist())
            check.add([f"{head.subject}/{head.expression}/{pose} {what}"])


@contextmanager
def _findings(
    root: Path,
    checker: PartChecker,
    manifest: Manifest,
    parts: list[PartInfo],
    quick: bool,
    workers: int | None,
) -> Iterator[Iterator[PartFindings]]:
    """The findings of every part, in order, from as many processes as pay."""
    if workers is None:
        enough = 1 if quick else 1 + manifest.rows // ROWS_A_WORKER
        workers = min(len(available_cores()), enough)
    if workers < 2:
        yield map(checker.quick if quick else checker.check, parts)
        return
    try:
        with ProcessPoolExecutor(workers, get_context("spawn"), _open, (root,)) as pool:
            yield pool.map(partial(_check, quick=quick), parts, chunksize=CHUNK)
    except BrokenProcessPool as error:
        raise DatasetError(
            f"{root}: a process that was checking it was killed, perhaps for memory; nothing was changed. "
            "Run it again with --workers 1"
        ) from error


_checker: PartChecker
"""Of this process, where it is one of several."""


def _open(root: Path) -> None:
    global _checker
    manifest = read_manifest(root)
    plan = csv_plan(root / POSES_FILE)
    _checker = PartChecker(root, manifest, read_heads(root), plan, read_anchors(root))


def _check(part: PartInfo, *, quick: bool) -> PartFindings:
    return _checker.quick(part) if quick else _checker.check(part)
