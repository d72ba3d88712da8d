# SPDX-License-Identifier: MIT
"""Heads' axes and angles, drawn on a picture."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.geometry.rotation import ANGLES
from downstream_hpe.prediction.face import Face
from downstream_hpe.prediction.given import Picture, rgb_of, without_copy
from downstream_hpe.prediction.pose import Pose

AXES = ((0, (255, 60, 60)), (1, (60, 210, 60)), (2, (70, 130, 255)))
"""Columns of R_C and their colours: image-right red, down green, and ahead of the nose blue."""
UNSURE = 0.7
"""So far towards grey is an axis that may be wrong."""
GREY = (185, 185, 185)
EDGE = (15, 15, 15)
SMALLEST = 384
"""A drawn copy has at least so many pixels on its shorter side, for its text to be read, unless the longer
one would have more than LARGEST."""
LARGEST = 4096
LEAST = 2.0
"""Pixels of a face's longer side."""

Box = tuple[float, float, float, float]
"""Left, top, right, bottom, pixels."""


def draw(picture: Picture, pose: Pose | None) -> Image.Image:
    """A copy of a picture, RGB, with the axes and angles of the faces of its pose.

    picture: as :meth:`Predictor.predict` takes it; it is not changed. pose: what that gave for it; None: no
    face, and nothing is drawn. Axes and colours as :func:`draw_faces`.

    Raises
    ------
    DataError: no picture, or a pose without landmarks or of another picture. UsageError: no pose.

    >>> from downstream_hpe import Predictor, draw
    >>> draw(np.zeros((480, 640, 3), np.uint8), None).size
    (640, 480)
    """
    if pose is not None and not isinstance(pose, Pose):
        raise UsageError(f"draw: expected the Pose that predict gave of it, got {type(pose).__name__}")
    image = Image.fromarray(rgb_of(picture))
    faces = [] if pose is None else _faces(pose, image.size)
    return _drawn(image, faces, len(faces) > 1)


def _faces(pose: Pose, size: tuple[int, int]) -> list[Face]:
    """size: width and height of the picture."""
    if pose.landmarks is None or pose.in_range is None:
        raise DataError("draw: the pose says not where its faces are; take one that a Predictor gave")
    low, high = pose.landmarks[..., :2].min(axis=1), pose.landmarks[..., :2].max(axis=1)
    if ((high - low).max(axis=1) < LEAST).any() or (low > size).any() or (high < 0).any():
        raise DataError(f"draw: the pose's landmarks are no pixels of a picture of {size[0]} x {size[1]}")
    confidences = [None] * len(pose) if pose.confidence is None else pose.confidence.tolist()
    parts = (pose.landmarks, pose.rotation, pose.ypr_deg, confidences, pose.in_range.tolist())
    return [Face(n, *each) for n, each in enumerate(zip(*parts, strict=True))]


def draw_faces(bgr: np.ndarray, faces: Sequence[Face], numbered: bool = False) -> np.ndarray:
    """A copy with the axes and angles of every face; the blue axis points where the nose does.

    Grey where the pose may not be believed: low confidence, or outside the trained range. Small
    pictures are enlarged. bgr: uint8 [H, W, 3]. numbered: with the indices of the faces.
    """
    image = Image.fromarray(without_copy(bgr))
    return np.asarray(_drawn(image, faces, numbered))[..., ::-1]


def _drawn(image: Image.Image, faces: Sequence[Face], numbered: bool) -> Image.Image:
    """image: RGB; it may be drawn on."""
    scale = max(1, min(-(-SMALLEST // min(image.size)), LARGEST // max(image.size)))
    if scale > 1:
        image = image.resize((image.width * scale, image.height * scale), Image.Resampling.LANCZOS)
    for face in faces:
        _axes(image, face, scale)
    # This mode blends what is drawn with alpha.
    draw = ImageDraw.Draw(image, "RGBA")
    # Labels keep clear of each other and of the middle of faces, as far as there is room.
    covered = [_middle(face, scale) for face in faces]
    for face in faces:
        covered.append(_label(draw, face, scale, image.size, numbered, covered))
    return image


def _axes(image: Image.Image, face: Face, scale: int) -> None:
    left, top, width, height = (side * scale for side in face.box)
    length = 0.6 * max(width, height)
    half = round(1.15 * length)
    # Drawn larger and reduced, as Pillow's lines have jagged edges.
    fine = max(1, min(3, 1000 // half))
    layer = Image.new("RGBA", (2 * half * fine, 2 * half * fine))
    draw = ImageDraw.Draw(layer)
    centre = np.array([half * fine, half * fine])
    thick = max(3, length / 28) * fine
    # The nose looks along -z of its own frame, towards the camera at pose zero.
    faded = 0.0 if face.sure else UNSURE
    ends = [(face.rotation[:, k] * (-1 if k == 2 else 1), _mixed(colour, faded)) for k, colour in AXES]
    # Far ends first, so that the nearer axis covers the farther one.
    for direction, colour in sorted(ends, key=lambda end: -end[0][2]):
        end = centre + length * fine * direction[:2]
        for edge, fill in ((1.5 * fine, EDGE), (0, colour)):
            draw.line([*centre, *end], fill=fill, width=round(thick + 2 * edge))
            for at, radius in ((centre, thick / 2 + edge), (end, thick + edge)):
                draw.ellipse([*(at - radius), *(at + radius)], fill=fill)
    layer = layer.reduce(fine)
    image.paste(layer, (round(left + width / 2) - half, round(top + height / 2) - half), layer)


def _mixed(colour: tuple[int, int, int], faded: float) -> tuple[int, ...]:
    return tuple(round((1 - faded) * c + faded * g) for c, g in zip(colour, GREY, strict=True))


def _middle(face: Face, scale: int) -> Box:
    left, top, width, height = (side * scale for side in face.box)
    return left + width / 8, top + height / 8, left + 7 * width / 8, top + 7 * height / 8


def _overlap(a: Box, b: Box) -> float:
    """Pixels that two boxes share."""
    return max(0.0, min(a[2], b[2]) - max(a[0], b[0])) * max(0.0, min(a[3], b[3]) - max(a[1], b[1]))


def _label(
    draw: ImageDraw.ImageDraw,
    face: Face,
    scale: int,
    size: tuple[int, int],
    numbered: bool,
    covered: Sequence[Box],
) -> Box:
    """Draw angles and confidence of a face, and say where."""
    left, top, width, height = (side * scale for side in face.box)
    lines = ["  ".join(f"{n} {round(float(a)):+d}°" for n, a in zip(ANGLES, face.ypr_deg, strict=True))]
    if numbered:
        lines[0] = f"#{face.index}  {lines[0]}"
    if face.confidence is not None:
        lines.append(f"confidence {face.confidence:.0%}")
    if not face.in_range:
        lines.append("outside the trained range")
    text = "\n".join(lines)
    points = min(max(height / 12, min(size) / (45 if numbered else 34), 12), min(size) / 16)
    font = ImageFont.load_default(size=points)
    pad = points / 3
    x0, y0, x1, y1 = draw.multiline_textbbox((0, 0), text, font=font)
    wide, high = x1 - x0 + 2 * pad, y1 - y0 + 2 * pad
    # Above the face where there is room, else below, else a little further off; always inside the picture.
    x = min(max(left + width / 2 - wide / 2, 0), max(size[0] - wide, 0))
    away = [step * (high + pad) for step in (0, 1, 2)]
    tops = [y for step in away for y in (top - high - pad - step, top + height + pad + step)]
    inside = [min(max(y, 0), max(size[1] - high, 0)) for y in tops]
    boxes = [(x, y, x + wide, y + high) for y in inside]
    box = min(boxes, key=lambda box: sum(_overlap(box, other) for other in covered))
    draw.rectangle(box, fill=(*EDGE, 185))
    ink = (255, 255, 255) if face.sure else (255, 205, 90)
    draw.multiline_text((x + pad - x0, box[1] + pad - y0), text, font=font, fill=ink)
    return box
