# SPDX-License-Identifier: GPL-3.0-or-later
"""What is behind the head, in linear light: float32 [H, W, 3], as the camera sees it."""

from __future__ import annotations

import math

import cv2
import numpy as np

from generator.geometry.camera import Camera
from generator.picture.develop import to_linear

COARSEST, OCTAVES = 2, 5
"""Cells across of the coarsest noise, and how often they are halved."""

SMALL = 64
"""Pixels that noise is made of along a side, at least."""


def seen_panorama(
    panorama: np.ndarray, camera: Camera, turn_deg: float, scale: float = 1.0, most: float = math.inf
) -> np.ndarray:
    """A panorama through a camera, infinitely far away.

    panorama: float32 [h, w, 3], see irradiance.py. Where it has fewer pixels than the image, they are
    enlarged smoothly, as what is out of focus. scale: what they are multiplied by. most: what they are cut
    off at before that: a sun is no wider than it is.
    """
    height, width = panorama.shape[:2]
    enlarged = max(1.0, 2 * np.pi / width * camera.focal_px)
    size = tuple(max(2, math.ceil(side / enlarged)) for side in (camera.width, camera.height))
    x, y = (
        (np.arange(n) + 0.5) * side / n for n, side in zip(size, (camera.width, camera.height), strict=True)
    )
    _, ray = camera.rays(np.stack(np.broadcast_arrays(x, y[:, None]), axis=-1))
    right, down, into = np.moveaxis(ray.astype(np.float32), -1, 0)
    across = (np.arctan2(right, into) - np.float32(np.deg2rad(turn_deg))) / np.float32(2 * np.pi) + 0.5
    along = np.arctan2(down, np.hypot(right, into)) / np.float32(np.pi) + 0.5
    columns, rows = across % 1.0 * width + 0.5, along * height - 0.5
    # What is seen, and one more column on either side: neighbours across the seam are neighbours.
    left, right_end = max(0, int(columns.min()) - 1), int(columns.max()) + 3
    top, bottom = max(0, int(rows.min()) - 1), int(rows.max()) + 3
    part = np.take(panorama[top:bottom], np.arange(left - 1, min(right_end, width + 2) - 1) % width, axis=1)
    part = np.minimum(part * np.float32(scale), np.float32(most))
    seen = cv2.remap(part, columns - left, rows - top, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    if size == (camera.width, camera.height):
        return seen
    smooth = cv2.GaussianBlur(seen, (3, 3), 0)  # otherwise cubic interpolation rings beside a sun
    whole = cv2.resize(smooth, (camera.width, camera.height), interpolation=cv2.INTER_CUBIC)
    return np.clip(whole, 0, None)


def noise(camera: Camera, seed: int) -> np.ndarray:
    """Smooth random colours, the same for the same seed: noise of several scales, coarse ones stronger."""
    rng = np.random.default_rng(seed)
    size = (camera.width, camera.height)
    # Smooth as it is, it is made of fewer pixels, of which the finest cells have two.
    small = tuple(min(side, max(SMALL, math.ceil(side / 4))) for side in size)
    base = rng.uniform(0.1, 0.9) + rng.uniform(-0.1, 0.1, 3)
    display = np.broadcast_to(base.astype(np.float32), (*small[::-1], 3))
    for octave in range(OCTAVES):
        cells = COARSEST * 2**octave + 3  # cubic interpolation needs a rim
        coarse = rng.standard_normal((cells, cells, 3)).astype(np.float32)
        # Colours that differ less than brightness does, as in the world.
        coarse = np.float32(0.2) * coarse + np.float32(0.8) * coarse.mean(axis=-1, keepdims=True)
        coarse *= 0.13 / 1.6**octave
        display = display + cv2.resize(coarse, small, interpolation=cv2.INTER_CUBIC)
    whole = cv2.resize(display, size, interpolation=cv2.INTER_CUBIC)
    return to_linear(np.rint(np.clip(whole, 0, 1) * 255).astype(np.uint8))


def filling(picture: np.ndarray, camera: Camera) -> np.ndarray:
    """The middle of a picture, as large as fills the image. picture: uint8 [h, w, 3], RGB in sRGB."""
    height, width = picture.shape[:2]
    scale = max(camera.width / width, camera.height / height)
    cut = (max(1, round(camera.width / scale)), max(1, round(camera.height / scale)))
    left, top = (width - cut[0]) // 2, (height - cut[1]) // 2
    part = to_linear(picture[top : top + cut[1], left : left + cut[0]])
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    return cv2.resize(part, (camera.width, camera.height), interpolation=way)


def before(head: np.ndarray, backdrop: np.ndarray) -> np.ndarray:
    """A head over a backdrop, float32 [H, W, 3], linear light, which is where they are mixed.

    head: float32 [H, W, 4], RGB multiplied by alpha: where half of a pixel is head, half of it is backdrop.
    """
    own = cv2.cvtColor(head, cv2.COLOR_RGBA2RGB)
    return cv2.add(own, cv2.merge([1 - head[..., 3]] * 3) * backdrop)
