# SPDX-License-Identifier: GPL-3.0-or-later
"""Proof that a dataset is complete, unchanged and consistent with itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from generator.cgroup import worthwhile
from generator.content import CONTENT, CONTENT_VERSION
from generator.dataset.format.anchors_table import ANCHORS_SINCE, read_anchors
from generator.dataset.format.columns import SCHEMA_VERSION
from generator.dataset.format.dataset_poses import read_dataset_poses
from generator.dataset.format.digest import add_digests
from generator.dataset.format.files import file_sha256
from generator.dataset.format.guard import dataset_file
from generator.dataset.format.heads_table import read_heads
from generator.dataset.format.manifest import Manifest, covered_files, read_manifest, side_tables
from generator.dataset.format.merkle import merkle_root
from generator.dataset.format.open import dataset_topology
from generator.dataset.format.part_info import PartInfo
from generator.dataset.format.schema import is_newer
from generator.dataset.proof.context import known_config
from generator.dataset.proof.exact_checks import anchor_problems, levelling_problems
from generator.dataset.proof.part_checks import PartChecker, PartFindings
from generator.dataset.proof.row_checks import row_checks
from generator.dataset.proof.twin_checks import TWINS
from generator.dataset.proof.twins_seen import TwinsSeen, has_twins
from generator.dataset.proof.verify_report import Check, VerifyReport
from generator.dataset.show.detection import DetectionTally
from generator.errors import DatasetError, HeadturnError, WorkerError
from generator.plan.factors import PART_FOLDERS
from generator.pool import processes
from generator.process import available_cores

_FIRST = ("manifest", "heads and poses", "part files", "part hashes", "schema", "no nulls", "every row once")
_QUICK = ("manifest", "heads and poses", "part files", "part sizes", "schema", "rows", "anchors")


def check_names(quick: bool = False, schema_version: str = SCHEMA_VERSION, twins: bool = False) -> list[str]:
    """What is checked of a dataset of this schema version, in the order of the report."""
    names = list(_QUICK) if quick else [*_FIRST, *row_checks(schema_version), "digest"]
    names += [TWINS] * twins
    if is_newer(ANCHORS_SINCE, schema_version):
        return [name for name in names if name != "anchors"]
    if not quick:
        names.insert(names.index("exact landmarks"), "anchors")
    return names


EXPECTED = "expected digest"
"""The check for which the user names a digest."""

ROWS_A_WORKER = 5000
"""With fewer rows than this for each, starting another process takes longer than it saves."""

CHUNK = 8
"""Parts a process takes at a time."""


def verify_dataset(
    path: Path,
    *,
    quick: bool = False,
    expected: str | None = None,
    workers: int | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> VerifyReport:
    """Check a dataset part by part, in memory that does not grow with its rows' content.

    It grows by the hash of each row, see :func:`generator.dataset.format.merkle.merkle_root`.

    quick: only what needs no reading of rows: the tables, the parts' sizes, footers and schemas,
        and that their rows add up to heads x poses.
    expected: the digest or the Merkle root that the rows must have, 64 hex digits; not with quick.
    workers: processes; default one a core, where there is enough to do.
    progress: called with (parts done, parts in all).
    Never raises for what is wrong with the dataset: every problem is a line of the report.

    Raises
    ------
    DatasetError: a process that was checking parts was killed. ValueError: expected with quick.
    """
    if quick and expected is not None:
        raise ValueError("only reading the rows shows what their digest is")
    root = Path(path)
    asked = [] if expected is None else [EXPECTED]
    checks = {name: Check(name) for name in [*check_names(quick), *asked]}
    try:
        manifest = read_manifest(root)
    except DatasetError as error:
        checks["manifest"].add([str(error)])
        return VerifyReport(tuple(checks.values()), quick=quick)
    # An older dataset has fewer columns, and fewer things to be wrong about.
    names = check_names(quick, manifest.schema_version, has_twins(manifest))
    checks = {name: Check(name) for name in [*names, *asked]}
    report = VerifyReport(tuple(checks.values()), quick=quick)
    checks["manifest"].done = True
    try:
        heads = read_heads(root)
        poses = read_dataset_poses(root, heads)
        anchors = read_anchors(root)
        tables = side_tables(manifest.schema_version)
        changed = [
            name for name in tables if file_sha256(dataset_file(root, name)) != manifest.tables.get(name)
        ]
        checker = PartChecker(root, manifest, heads, poses, anchors)
        config = known_config(manifest, root)
    except (OSError, HeadturnError) as error:
        checks["heads and poses"].add([str(error)])
        return report
    checks["heads and poses"].add(f"{name} was changed after the build (SHA-256 differs)" for name in changed)
    checks["manifest"].add(_changed_files(root, manifest))
    if "anchors" in checks:
        checks["anchors"].add(anchor_problems(heads, anchors))
        if manifest.versions.get(CONTENT) == str(CONTENT_VERSION):
            topology = dataset_topology(root, manifest)
            checks["anchors"].add(levelling_problems(heads, anchors, topology))
    for check in checks.values():
        check.done = True
    parts = _present_parts(root, manifest, checks["part files"])
    tally, twins = DetectionTally(heads, poses), TwinsSeen(config, heads, poses)
    rows, closure_deg, digests, hashes = 0, 0.0, list[str](), list[bytes]()
    with _findings(root, checker, manifest, parts, quick, workers) as findings:
        for done, (part, found) in enumerate(zip(parts, findings, strict=True), start=1):
            for name, problems in found.checks.items():
                checks[name].merge(problems)
            if part.of_twins:
                twins.add(found)
            elif found.digest is not None:
                rows += found.rows
                digests.append(found.digest)
                hashes.append(found.hashes)
            closure_deg = max(closure_deg, found.measured.get("closure_deg", 0.0))
            for places in zip(found.heads, found.poses, found.detected, strict=True):
                tally.add(*places)
            if progress:
                progress(done, len(parts))
    if len(heads) != manifest.heads:
        checks["heads and poses"].add(
            [f"heads.parquet has {len(heads)} heads, the manifest says {manifest.heads}"]
        )
    if TWINS in checks:
        checks[TWINS].add(twins.problems(manifest, quick))
        report = replace(report, twins=twins.proved(quick))
    whole = replace(report, heads=len(heads), poses=poses.most, rows=rows)
    if quick:
        if rows != poses.rows:
            checks["rows"].add(
                [f"{rows} rows, expected {poses.rows}: {len(heads)} heads x {poses.most} poses"]
            )
        return replace(
            whole,
            digest=manifest.digest,
            detected_rows=manifest.detected_rows,
            detection_rate=manifest.detected_rows / manifest.rows if manifest.rows else float("nan"),
        )
    _check_every_row_once(tally, manifest, checks["every row once"])
    for name in ("no nulls", *row_checks(manifest.schema_version)):
        checks[name].done = bool(rows)  # of rows that nobody could read nothing is known
    digest, merkle = add_digests(digests), merkle_root(hashes)
    if digest != manifest.digest:
        checks["digest"].add(["the digest of all rows is not the manifest's"])
    if expected is not None and expected not in (digest, merkle):
        checks[EXPECTED].add([f"neither digest nor Merkle root of the rows is {expected}"])
    return replace(
        whole,
        digest=digest,
        merkle_root=merkle,
        expected=expected,
        detected_rows=int(tally.detected.sum(dtype=np.int64)),
        detection_rate=tally.rate,
        closure_deg=closure_deg,
        rate_by_subject=tally.by_subject(),
        cells=tuple(tally.by_cell()),
    )


def _changed_files(root: Path, manifest: Manifest) -> Iterator[str]:
    """The small files beside the tables that are not those of the build."""
    if manifest.files is None:  # written before they were covered
        return
    try:
        now = covered_files(root)
    except (OSError, DatasetError) as error:
        yield str(error)
        return
    for name in sorted({*now, *manifest.files}):
        if now.get(name) != manifest.files.get(name):
            what = "is missing" if name not in now else "was changed, or added, after the build"
            yield f"{name} {what}"


def _present_parts(root: Path, manifest: Manifest, check: Check) -> list[PartInfo]:
    """The listed parts that exist; missing and unlisted files become problems."""
    listed = (*manifest.parts, *manifest.twins)
    expected = {part.path for part in listed}
    there = (p for folder in PART_FOLDERS for p in (root / folder).rglob("*") if not p.is_dir())
    found = {p.relative_to(root).as_posix() for p in there}
    check.add(f"{path} is missing" for path in sorted(expected - found))
    check.add(f"{path} is not listed in the manifest" for path in sorted(found - expected))
    return [part for part in listed if part.path in found]


def _check_every_row_once(tally: DetectionTally, manifest: Manifest, check: Check) -> None:
    """What only all rows together can show: none missing, none twice."""
    seen = tally.rows
    missing = (seen == 0) & (np.arange(seen.shape[1]) < tally.poses.counts[:, None])
    if manifest.failures and missing.any():
        check.add([f"{manifest.failures} units failed, see failures.jsonl"])
    for wrong, what in ((missing, "is missing"), (seen > 1, "is there more than once")):
        for place, k in np.argwhere(wrong).tolist():
            head = tally.heads[place]
            check.add([f"{head.subject}/{head.expression}/{tally.poses.name(place, k)} {what}"])


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
        workers = min(worthwhile(available_cores()), enough)
    if workers < 2:
        yield map(checker.quick if quick else checker.check, parts)
        return
    try:
        with processes(workers, partial(_open, root)) as spread:
            yield spread(partial(_check, quick=quick), parts, CHUNK)
    except WorkerError as error:
        raise DatasetError(
            f"{root}: a process that was checking it was killed, perhaps for memory; nothing was changed. "
            "Run it again with --workers 1"
        ) from error


_checker: PartChecker
"""Of this process, where it is one of several."""


def _open(root: Path) -> None:
    global _checker
    manifest = read_manifest(root)
    heads = read_heads(root)
    _checker = PartChecker(root, manifest, heads, read_dataset_poses(root, heads), read_anchors(root))


def _check(part: PartInfo, *, quick: bool) -> PartFindings:
    return _checker.quick(part) if quick else _checker.check(part)
