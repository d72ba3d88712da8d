# SPDX-License-Identifier: GPL-3.0-or-later
"""Render one sample of a finished dataset again, the way it was built, and compare."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from generator.dataset.format.anchors_table import read_anchors
from generator.dataset.format.files import file_sha256, write_bytes
from generator.dataset.format.heads_table import HeadRow, read_heads
from generator.dataset.format.manifest import Manifest, read_manifest
from generator.dataset.format.open import image_bytes, read_samples
from generator.dataset.format.part import read_part
from generator.dataset.proof.compare import row_differences
from generator.errors import DatasetError, HeadError, UsageError, WorkerError
from generator.execution.build.sources import source_path
from generator.execution.build.units import build_order
from generator.execution.executors.open import open_executor
from generator.execution.lanes.scratch import scratch_folder
from generator.heads.head import Head
from generator.heads.placement import Placement
from generator.heads.source import find_heads
from generator.messages import BuildOrder, Built, expect
from generator.plan.config import BuildConfig, recorded_config
from generator.plan.view_plan import plan_views
from generator.plan.views import Pose


@dataclass(frozen=True)
class Replay:
    """What came out the second time.

    same: image, passes, detection and landmarks are the recorded ones, bit by bit.
    differences: a line each. versions: what ran then and now, where it is not the same.
    """

    sample_id: str
    same: bool
    differences: tuple[str, ...]
    versions: tuple[str, ...]

    def text(self) -> str:
        """For people."""
        if self.same:
            return f"{self.sample_id}: the same image, landmarks and labels, bit by bit"
        return "\n".join([f"{self.sample_id}: not the same", *self.differences, *self.versions])


def replay_sample(
    root: Path,
    sample_id: str,
    *,
    heads: Path | None = None,
    picture: Path | None = None,
    blender: str | None = None,
) -> Replay:
    """Build one row again from the dataset's configuration and head files.

    Parameters
    ----------
    heads: where the head source lies now, if it was moved.
    picture: where the new image is written, if anywhere.

    Raises
    ------
    UsageError: there is no such sample. HeadError: the head's files are gone or
    were changed. DatasetError: the dataset cannot be read.
    """
    manifest = read_manifest(root)
    recorded = read_samples(root, manifest, [sample_id]).get(sample_id)
    if recorded is None:
        example = next(iter(manifest.parts)).subject or "subject"
        raise UsageError(
            f"{root}: no sample {sample_id!r}; names are like {example}/neutral/y+30_p-10_r+0, "
            "see the column sample_id"
        )
    config = recorded_config(manifest.configuration, root)
    subject, expression = recorded["subject"], recorded["expression"]
    row = next(h for h in read_heads(root) if (h.subject, h.expression) == (subject, expression))
    head = _find(row, config, root, heads)
    anchors = read_anchors(root)[subject, expression]
    with open_executor("local", workers=1, blender=blender) as lanes, scratch_folder() as scratch:
        order = _order(row, head, anchors.points, config, recorded, scratch)
        [outcome] = lanes.run([order], lambda: None)
        if outcome.receipt is None:
            raise WorkerError(f"{sample_id}: cannot be rendered again: {outcome.error}")
        built = expect(Built, outcome.receipt)
        again = read_part(scratch / built.part.path)
        now = again.to_pylist()[0]
        image = image_bytes(scratch, now)
        if picture is not None:
            write_bytes(picture, image)
        differences = row_differences(recorded, now, lambda: _image_detail(recorded, image, root, manifest))
    versions = [
        f"{name}: {manifest.versions.get(name, 'none')} then, {now} now"
        for name, now in built.versions.items()
        if manifest.versions.get(name) != now
    ]
    return Replay(sample_id, not differences, tuple(differences), tuple(versions))


def _find(row: HeadRow, config: BuildConfig, root: Path, moved: Path | None) -> Head:
    """The head of a row, its files checked against the hashes of the build."""
    wanted = config.heads
    path = moved or source_path(config, root)
    again = "give the place it was moved to with --heads, or put it back"
    if not path.exists():
        raise HeadError(f"{path}: the heads of this dataset are not there any more; {again}")
    base = path if path.is_dir() else path.parent
    for name, sha256 in row.file_sha256:
        if not (base / name).is_file():
            raise HeadError(f"{base / name}: a file of {row.subject}/{row.expression} is gone; {again}")
        if file_sha256(base / name) != sha256:
            raise HeadError(
                f"{base / name}: was changed after the build (SHA-256 differs); replay needs the "
                "file as it was"
            )
    source = find_heads(
        path,
        expressions=wanted.expressions,
        license=wanted.license,
        redistributable=wanted.redistributable,
        units=wanted.units,
        up=wanted.up,
        forward=wanted.forward,
    )
    for head in source.heads:
        if (head.subject, head.expression) == (row.subject, row.expression):
            return head
    raise HeadError(f"{path}: no head {row.subject}/{row.expression} there any more; {again}")


def _order(
    row: HeadRow, head: Head, points: np.ndarray, config: BuildConfig, recorded: dict[str, Any], root: Path
) -> BuildOrder:
    """The build order of one pose, with what placing the head found at the time."""
    placement = Placement(
        units=row.units,
        mm_per_unit=row.mm_per_unit,
        up=row.up,
        forward=row.forward,
        pivot=row.pivot,
        radius_mm=row.radius_mm,
        eye_distance_mm=float("nan"),
        frame=row.frame,
        correction=row.correction,
        correction_sd_deg=row.correction_sd_deg,
    )
    pose: Pose = (recorded["yaw_deg"], recorded["pitch_deg"], recorded["roll_deg"])
    views = plan_views(config, head.name, row.radius_mm, [pose])
    indices = (recorded["yaw_index"], recorded["pitch_index"], recorded["roll_index"])
    order = build_order(head, placement, points, row.split, views, (indices,), config, root)
    return replace(order, unit="again", images="embedded")


def _image_detail(recorded: dict[str, Any], image: bytes, root: Path, manifest: Manifest) -> str:
    """How far two images are apart; "" where the first was not kept."""
    if manifest.images == "none":
        return ""
    then = _decode(image_bytes(root, recorded))
    difference = np.abs(_decode(image).astype(int) - then.astype(int))
    share = (difference.max(axis=2) > 0).mean()
    return f": up to {difference.max()} of 255 levels, on {share:.2%} of its pixels"


def _decode(image: bytes) -> np.ndarray:
    pixels = cv2.imdecode(np.frombuffer(image, np.uint8), cv2.IMREAD_COLOR)
    if pixels is None:
        raise DatasetError("an image of the dataset cannot be decoded; see `headturn verify`")
    return pixels
