# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of verify that looks at the pictures: decode them, render them again, compare."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import chain
from pathlib import Path

from generator.dataset.format.dataset_poses import read_dataset_poses
from generator.dataset.format.heads_table import read_heads
from generator.dataset.format.manifest import read_manifest
from generator.dataset.format.open import dataset_topology
from generator.dataset.proof.choose import choose_rows, choose_twins
from generator.dataset.proof.context import known_config
from generator.dataset.proof.verify_report import Check, Deep, VerifyReport
from generator.execution.replay import replay_samples
from generator.plan.settings import Landmarks
from generator.process import available_cores
from generator.registries import DETECTORS

DEEP = "images again"
"""The check of the report."""


def look_deep(
    report: VerifyReport,
    root: Path,
    count: int | None,
    *,
    seed: int = 0,
    heads: Path | None = None,
    blender: str | None = None,
    workers: int | None = None,
    on_start: Callable[[int], None] = lambda total: None,
    on_image: Callable[[], None] = lambda: None,
) -> VerifyReport:
    """The report of :func:`generator.dataset.proof.verify.verify_dataset` with what count rows show.

    Each is decoded, measured and rendered again; see :func:`generator.execution.replay.replay_samples`
    for heads, blender, workers and on_image. count: None for all rows, and all twins. seed: see
    :func:`generator.dataset.proof.choose.choose_rows`. on_start: called with the number of rows.
    Rows that could not be rendered are told in ``report.deep``. A report that is not ok comes back with
    the check not done: images of a dataset that contradicts itself prove nothing.

    Raises
    ------
    DatasetError: the dataset cannot be read any more.
    """
    check = Check(DEEP)
    whole = replace(report, checks=(*report.checks, check))
    if not report.ok:
        return whole
    manifest, rows = read_manifest(root), read_heads(root)
    poses = read_dataset_poses(root, rows)
    config = known_config(manifest, root)
    check.add(_detector_problems(config.landmarks, dataset_topology(root, manifest).name))
    chosen = poses.rows if count is None else min(count, poses.rows)
    names = choose_rows(rows, poses, count, seed)
    every = chosen == poses.rows
    if every and manifest.twins:
        names = chain(names, choose_twins(config, rows, poses))
        chosen += sum(part.rows for part in manifest.twins)
    on_start(chosen)
    decoded = rendered = 0
    left_out: Counter[str] = Counter()
    versions: dict[str, None] = {}
    found = replay_samples(
        root,
        names,
        heads=heads,
        blender=blender,
        workers=min(workers or len(available_cores()), max(chosen, 1)),
        on_image=on_image,
    )
    for replay in found:
        decoded += replay.decoded
        check.add(f"{replay.sample_id}: {difference}" for difference in replay.differences)
        if replay.not_rendered is not None:
            left_out[str(replay.not_rendered)] += 1
        else:
            rendered += 1
            versions.update(dict.fromkeys(replay.versions))
    if lost := chosen - rendered - left_out.total():
        check.add([f"{lost} rows are not in the parts that the manifest lists for their heads"])
    check.done = True
    deep = Deep(
        chosen=chosen,
        all_rows=every,
        seed=seed,
        images=manifest.images,
        decoded=decoded,
        rendered=rendered,
        not_rendered=dict(left_out),
        versions=tuple(versions),
    )
    return replace(whole, deep=deep)


def _detector_problems(landmarks: Landmarks, topology: str) -> list[str]:
    """The rows' landmarks against what the recorded detector finds."""
    finds = DETECTORS.get(landmarks.detector).topology.name
    if finds == topology:
        return []
    return [
        f"the rows have the landmarks {topology}; the recorded detector {landmarks.detector} finds {finds}"
    ]
