# SPDX-License-Identifier: GPL-3.0-or-later
"""Proof of the exact landmarks: they are the anchors, turned by R_C, and give R_C back."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import pyarrow as pa

from generator.dataset.format.anchors_table import HeadAnchors
from generator.dataset.format.heads_table import IDENTITY, HeadRow
from generator.dataset.format.open import as_array
from generator.dataset.format.row_cameras import RowCameras
from generator.dataset.proof.context import RowContext
from generator.dataset.proof.named import named
from generator.geometry.rigid import fit_rotations
from generator.geometry.rotation import geodesic_deg, graphics_rotation
from generator.landmarks.anchors import WEIGHTS_SUM
from generator.landmarks.shared import packaged, shared_levelling_problem
from generator.landmarks.topology import Topology

CLOSURE_DEG = 1e-6
"""How near the rigid fit must come to R_C, besides the rounding of float32."""


def anchor_problems(heads: Sequence[HeadRow], anchors: dict[tuple[str, str], HeadAnchors]) -> Iterator[str]:
    """anchors.parquet against heads.parquet: every head once, points missing as often as it says."""
    names = {(head.subject, head.expression) for head in heads}
    for subject, expression in sorted(set(anchors) - names):
        yield f"anchors.parquet: {subject}/{expression} is not in heads.parquet"
    for head in heads:
        found = anchors.get((head.subject, head.expression))
        if found is None:
            yield f"anchors.parquet: {head.subject}/{head.expression} is missing"
            continue
        absent = np.isnan(found.points).all(axis=1)
        if not (absent | np.isfinite(found.points).all(axis=1)).all():
            yield f"anchors.parquet: {head.subject}/{head.expression}: a point is neither finite nor NaN"
        elif (absent != (found.triangles < 0)).any() or int(absent.sum()) != head.anchor_absent:
            yield (
                f"anchors.parquet: {head.subject}/{head.expression}: {int(absent.sum())} points without "
                f"an anchor, heads.parquet says {head.anchor_absent}"
            )
        elif (np.abs(found.weights[~absent].sum(axis=1) - 1) > WEIGHTS_SUM).any():
            yield f"anchors.parquet: {head.subject}/{head.expression}: weights do not add up to 1"


def levelling_problems(
    heads: Sequence[HeadRow], anchors: dict[tuple[str, str], HeadAnchors], topology: Topology
) -> Iterator[str]:
    """Each subject's correction against the anchors of its heads, and anchors of the package against those.

    Only of use where the dataset is of today's content version: another may have had another mean face.
    """
    ours = [shared.anchors.weights for shared in packaged(topology)]
    for head in heads:
        found = anchors.get((head.subject, head.expression))
        if head.anchor_way == "package" and found is not None:
            there = np.isfinite(found.weights)
            if not any(np.array_equal(found.weights[there], weights[there]) for weights in ours):
                yield f"anchors.parquet: {head.subject}/{head.expression}: not the anchors of the package"
    subjects: dict[str, list[HeadRow]] = {}
    for head in heads:
        subjects.setdefault(head.subject, []).append(head)
    for subject, rows in subjects.items():
        first = rows[0]
        if any((h.frame, h.correction) != (first.frame, first.correction) for h in rows):
            yield f"heads.parquet: {subject} has more than one correction"
            continue
        levelled = np.reshape(IDENTITY if first.frame == "source" else first.correction, (3, 3))
        turned = graphics_rotation(levelled)
        points = [
            anchors[h.subject, h.expression].points for h in rows if (h.subject, h.expression) in anchors
        ]
        own = [p @ turned for p in points if p.shape == (topology.count, 3)]  # row vectors: R^T x
        problem = shared_levelling_problem(
            first.frame, first.correction, first.correction_sd_deg, own, topology, first.anchor_way
        )
        if problem:
            yield f"heads.parquet: {subject}: {problem}"


def exact_problems(batch: pa.RecordBatch, context: RowContext) -> list[str]:
    """Each row's exact landmarks and visibility against its anchors and its camera.

    Notes closure_deg: the largest angle in degrees between R_C and the rotation of the rigid fit of
    the anchors to landmarks_exact.
    """
    exact = as_array(batch, "landmarks_exact").astype(np.float64)
    visible = as_array(batch, "landmarks_visible").astype(bool)
    rotation = as_array(batch, "rotation").reshape(-1, 3, 3)
    cameras = RowCameras.of(batch)
    anchors = context.anchors[context.head_index]
    expected = anchors @ np.swapaxes(rotation, -1, -2) + cameras.translation_mm[:, None]
    anchored = np.isfinite(anchors).all(axis=2)
    # One rounding to float32, and the last bit of the sum that was rounded.
    allowed = np.spacing(np.abs(np.nan_to_num(expected)).astype(np.float32))
    off = np.where(anchored[..., None], ~(np.abs(exact - expected) <= allowed), ~np.isnan(exact))
    problems = list(named(batch, off.any(axis=(1, 2)), "landmarks_exact is not R_C X + t of its anchors"))
    problems += named(batch, (visible & ~anchored).any(axis=1), "a landmark without an anchor is visible")
    for place in np.unique(context.head_index):
        rows = np.flatnonzero(context.head_index == place)
        inside = anchored[rows[0]]
        sound = rows[~off[rows].any(axis=(1, 2))]
        if inside.sum() < 3 or not len(sound):
            continue
        points = anchors[rows[0], inside]
        errors = geodesic_deg(fit_rotations(points, exact[sound][:, inside]), rotation[sound])
        wrong = np.zeros(len(batch), dtype=bool)
        wrong[sound] = errors > CLOSURE_DEG + _rounding_deg(points, cameras.translation_mm[sound, 2])
        problems += named(batch, wrong, "the rigid fit of landmarks_exact does not give rotation back")
        context.note("closure_deg", float(errors.max()))
    beyond = anchored & ~cameras.inside(cameras.pixels(np.nan_to_num(expected, nan=1.0)))
    problems += named(batch, (visible & beyond).any(axis=1), "a landmark outside the image is visible")
    return problems


def _rounding_deg(points: np.ndarray, distance_mm: np.ndarray) -> np.ndarray:
    """Six standard deviations of the rotation of a fit to points rounded to float32 at each distance."""
    sigma = np.spacing(distance_mm.astype(np.float32)).astype(np.float64) / np.sqrt(12)
    centred = points - points.mean(axis=0)
    weakest = np.linalg.svd(centred, compute_uv=False)[-2:]
    return np.rad2deg(6 * sigma / np.sqrt((weakest**2).sum()))
