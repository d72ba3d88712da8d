# SPDX-License-Identifier: MIT
"""Small videos, as phones and cameras make them, and a stand-in for a predictor that sees bright bars."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np

from downstream_hpe.geometry.rotation import rotation_from_angles
from downstream_hpe.prediction.inputs import find_sources
from downstream_hpe.prediction.predictions import Options, predictions
from downstream_hpe.prediction.predictor import Pose
from downstream_hpe.prediction.six_degrees import place

SHAPE = np.random.default_rng(0).uniform(-8, 8, size=(468, 3))


def at(x):
    """A face around column x."""
    return SHAPE + np.array([x, 32, 0])


class Spots:
    """Stands for a predictor: a face at every column of bright pixels, whose yaw is where it is."""

    def faces(self, bgr, limit, turned):
        columns = np.flatnonzero(bgr[32, :, 0] > 100)
        starts = columns[np.diff(columns, prepend=-9) > 1]
        return np.array([at(x + 5) for x in starts[:limit]]).reshape(-1, 468, 3)

    def face_at(self, bgr, place):
        (x, y), _ = place
        return at(x) if bgr[int(y), int(x), 0] > 100 else None

    def faces_in_tile(self, bgr, tile, before):
        return []

    def from_landmarks(self, landmarks, camera):
        ypr = np.stack([landmarks[:, :, 0].mean(1), landmarks[:, 0, 0] * 0, landmarks[:, 0, 0] * 0], axis=1)
        rotation = rotation_from_angles(ypr)
        axis, translation_mm = place(landmarks, rotation, camera)
        return Pose(ypr, rotation, np.full(len(ypr), 0.9), ypr, axis, translation_mm)

    def in_range(self, ypr_deg):
        return bool(ypr_deg[0] < 50)


def bars(*xs):
    """uint8 [64, 64, 3]: bright from each column on, ten wide."""
    image = np.zeros((64, 64, 3), dtype=np.uint8)
    for x in xs:
        image[:, x : x + 10] = 255
    return image


def quarters():
    """uint8 [64, 96, 3], RGB: another grey in each quarter, which tells eight ways to lay it."""
    image = np.zeros((64, 96, 3), dtype=np.uint8)
    image[:32, :48], image[:32, 48:], image[32:, :48], image[32:, 48:] = 40, 100, 160, 220
    return image


def corners(image):
    """The greys of the four quarters of a picture, by reading order, to the nearest of those above."""
    height, width = image.shape[:2]
    greys = [image[y, x, 0] for y in (height // 4, 3 * height // 4) for x in (width // 4, 3 * width // 4)]
    return [int(60 * round((float(grey) - 40) / 60) + 40) for grey in greys]


def rows_of(given, drawn: Path | None = None, **options):
    """What predict says of an input, with Spots, and what it notes."""
    notes: list[str] = []
    every = find_sources([str(given)], drawn)
    return list(predictions(every, Spots(), Options(**options), notes.append)), notes


def make(path: Path, codec: str, images, times=None, form=None, pixels="yuv420p", turned=0, aspect=None):
    """A video of RGB pictures at times in seconds; a tenth of one apart if absent."""
    import av

    with av.open(str(path), "w", format=form) as container:
        stream = container.add_stream(codec, rate=10)
        stream.height, stream.width = images[0].shape[:2]
        stream.pix_fmt = pixels
        if aspect:
            stream.codec_context.sample_aspect_ratio = aspect
        if turned:
            stream.set_display_rotation(turned)
        for n, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(np.ascontiguousarray(image), format="rgb24")
            if times is not None:
                frame.pts, frame.time_base = round(1000 * times[n]), Fraction(1, 1000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    return path
