# SPDX-License-Identifier: GPL-3.0-or-later
"""Proof of the passes: unchanged, seen by the row's camera, and of one mind with the ray casts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import pyarrow as pa

from generator.dataset.format.guard import dataset_file
from generator.dataset.format.open import as_array
from generator.dataset.format.passes import passes_sha256, read_channels
from generator.dataset.format.row_cameras import RowCameras
from generator.dataset.format.schema import passes_path
from generator.dataset.proof.context import RowContext
from generator.errors import DatasetError, UsageError
from generator.plan.passes import DEPTH, POSITION, SEGMENTATION

PROJECTION_PX = 0.01
"""How near the position of a pixel must be projected to the pixel's centre."""

SLIVERS = 1e-3
"""Share of pixels that may be farther off: a triangle seen edge-on is narrower than the rounding of
float32 in the ray tracer. One pixel in three million was."""

DEPTH_MM = 1.0
"""How far a landmark may lie outside the depths of the pixels around it. Rays see edges and
lashes that are thinner than a pixel; a pixel does not."""

SUM = 1e-3
"""How near the classes of a pixel must add up to 1."""

MAX_DISAGREEING = 0.01
"""Share of a row's landmarks for which ray cast and depth may differ, for the same reason."""


def pass_problems(batch: pa.RecordBatch, context: RowContext) -> Iterator[str]:
    """The passes of rows that have some, against hash, K, exact landmarks and visibility."""
    names = batch.column("sample_id").to_pylist()
    paths = batch.column("passes_path").to_pylist()
    hashes = batch.column("passes_sha256").to_pylist()
    if not any(paths) and not any(hashes):
        return
    exact = as_array(batch, "landmarks_exact").astype(np.float64)
    visible = as_array(batch, "landmarks_visible").astype(bool)
    cameras = RowCameras.of(batch)
    for row, (name, path, sha256) in enumerate(zip(names, paths, hashes, strict=True)):
        if not path and not sha256:
            continue
        subject, expression, pose = name.split("/", 2)
        if path != passes_path(subject, expression, pose):
            yield f"{name}: passes_path {path!r} is not where its passes belong"
            continue
        try:
            channels = read_channels(dataset_file(context.root, path))
        except (DatasetError, UsageError) as error:
            yield str(error)
            continue
        if passes_sha256(channels) != sha256:
            yield f"{path}: the passes are not those that were rendered (SHA-256 differs)"
            continue
        camera = cameras[row : row + 1]
        size = (int(camera.height[0]), int(camera.width[0]))
        if any(values.shape != size for values in channels.values()):
            yield f"{path}: not the size of the image"
            continue
        if set(POSITION.channel_names) <= set(channels):
            position = np.stack([channels[name] for name in POSITION.channel_names], axis=-1) * 1e3
            off = projection_error_px(position, camera)
            if not off <= PROJECTION_PX:
                yield f"{path}: positions do not project onto their own pixels (off by {off:.3g} px)"
        if set(SEGMENTATION.channel_names) <= set(channels) and (problem := segmentation_problem(channels)):
            yield f"{path}: {problem}"
        if set(DEPTH.channel_names) <= set(channels):
            depth = channels[DEPTH.channel_names[0]] * 1e3
            wrong = disagreement(depth, exact[row], visible[row], camera)
            if wrong > MAX_DISAGREEING:
                yield f"{path}: landmarks_visible and depth disagree on {wrong:.1%} of the landmarks"


def segmentation_problem(channels: Mapping[str, np.ndarray]) -> str:
    """What is wrong with the classes of an image, or "": shares outside 0 to 1, sums that are not 1, nothing
    where the depth has a surface."""
    classes = np.stack([channels[name] for name in SEGMENTATION.channel_names])
    if not (np.isfinite(classes).all() and (classes >= -SUM).all()):
        return "a share of the segmentation is below 0"
    if np.abs(classes.sum(axis=0) - 1).max() > SUM:
        return "the classes of the segmentation do not add up to 1"
    if DEPTH.channel_names[0] in channels:
        surface = np.isfinite(channels[DEPTH.channel_names[0]])
        if (surface & (classes[0] > 1 - SUM)).mean() > SLIVERS:
            return "the segmentation has nothing where the depth has a surface"
    return ""


def projection_error_px(position_mm: np.ndarray, camera: RowCameras) -> float:
    """Distance, in x or y, from a pixel's centre to where K puts what it shows: exceeded by a
    thousandth of the pixels.

    position_mm: float [H, W, 3], frame C, NaN where there is no surface. camera: that of the one row.
    0 without a surface.
    """
    height, width = position_mm.shape[:2]
    centres = np.stack(np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5), axis=-1)
    there = np.isfinite(position_mm).all(axis=-1)
    if not there.any():
        return 0.0
    seen = camera.pixels(position_mm[there][None])[0, :, :2]
    off = np.abs(seen - centres[there]).max(axis=1)
    return float(np.quantile(off, 1 - SLIVERS, method="lower"))


def disagreement(depth_mm: np.ndarray, exact: np.ndarray, visible: np.ndarray, camera: RowCameras) -> float:
    """Share of the landmarks inside the image that one of ray cast and depth sees and the other not.

    depth_mm: float [H, W], NaN where there is no surface. exact: float [P, 3], frame C, mm.
    camera: that of the one row.
    A landmark agrees with the depth pass if its depth lies among those of the 3 x 3 pixels around
    it where it is visible, and behind the nearest of them where it is hidden.
    """
    height, width = depth_mm.shape
    known = np.flatnonzero(np.isfinite(exact).all(axis=1))
    pixels = np.floor(camera.pixels(exact[None, known])[0, :, :2]).astype(int)
    inside = ((pixels >= 1) & (pixels < (width - 1, height - 1))).all(axis=1)
    known, pixels = known[inside], pixels[inside]
    if not len(known):
        return 0.0
    around = np.arange(-1, 2)
    patches = depth_mm[
        pixels[:, 1, None, None] + around[None, :, None], pixels[:, 0, None, None] + around[None, None, :]
    ].reshape(len(known), 9)
    # Beside the silhouette there is nothing as far as one can see.
    nearest = np.where(np.isnan(patches), np.inf, patches).min(axis=1)
    farthest = np.where(np.isnan(patches), np.inf, patches).max(axis=1)
    z = exact[known, 2]
    shown = (z >= nearest - DEPTH_MM) & (z <= farthest + DEPTH_MM)
    hidden = z >= nearest - DEPTH_MM
    return float((~np.where(visible[known], shown, hidden)).mean())
