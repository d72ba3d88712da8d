# SPDX-License-Identifier: GPL-3.0-or-later
"""Glasses: before the eyes, over the bridge of the nose, free of lids, brows and cheeks, behind the ears."""

from __future__ import annotations

from itertools import product

import numpy as np

from generator.heads.mesh import HeadMesh, Material
from generator.labels import GLASSES
from generator.plan.wear import NOTHING
from generator.worn.colours import ACETATE, METAL, Colour, drawn, luminance, mottled
from generator.worn.face import Face
from generator.worn.fit import CannotWear, Fit, Kind
from generator.worn.shapes import Part, Shape, assemble
from generator.worn.spectacle_frames import FRAMES, Frame
from generator.worn.spectacle_parts import Front, bridge, lens, pads, rim, temple

NASION = 168
"""Landmark: the nose's root, between the eyes."""

VERTEX_MM = 12.0
"""From the eye to the lens, at least."""

MOST_VERTEX_MM = 34.0
"""Glasses that would stand farther from the eye than this do not fit."""

FREE_MM = 1.2
"""Between frame and face."""

LENS_FREE_MM = 2.0

OVER_MASK_MM = 3.0

GAPS_MM = (16.0, 18.0, 20.0, 22.0, 24.0, 26.0)
"""Widths of a bridge, of which the one is chosen that sits best."""

UP_MM = (0.0, 3.0, 5.5)
"""By how much glasses stand higher, tried in this order."""

TINTS: dict[Colour, float] = {
    (0.42, 0.30, 0.22): 3, (0.32, 0.33, 0.35): 3, (0.62, 0.50, 0.22): 1, (0.55, 0.32, 0.36): 1,
    (0.28, 0.36, 0.50): 1,
}  # fmt: skip
DARKS: dict[Colour, float] = {(0.04, 0.04, 0.045): 4, (0.10, 0.065, 0.045): 2, (0.05, 0.075, 0.06): 1}
MIRRORS: dict[Colour, float] = {
    (0.36, 0.46, 0.62): 2, (0.62, 0.56, 0.44): 2, (0.55, 0.57, 0.60): 2, (0.50, 0.34, 0.44): 1,
}  # fmt: skip

PAD: Colour = (0.80, 0.78, 0.74)

_LENSES: dict[str, tuple[dict[Colour, float], float]] = {
    "clear": ({(0.90, 0.94, 0.97): 1}, 0.08),
    "tinted": (TINTS, 0.45),
    "dark": (DARKS, 0.85),
    "mirror": (MIRRORS, 0.95),
}
"""Kind of lens -> its colours and opacity."""


def make(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    """See :data:`generator.worn.fit.Make`."""
    face, frame = Face.of(fit), FRAMES[style]
    over = OVER_MASK_MM if fit.others.get("mask", NOTHING) != NOTHING else 0.0
    size = float(rng.uniform(0.97, 1.05))
    metal, plastic = drawn(METAL, rng), drawn(ACETATE, rng)
    wire = Material("frame metal", metal, label=GLASSES, gloss=0.75)
    acetate = Material("frame", plastic, label=GLASSES, gloss=0.5)
    palette, opacity = _LENSES[fit.others.get("lenses", "clear")]
    glass = drawn(palette, rng, 0.01)
    pane = Material("lenses", glass, label=GLASSES, gloss=0.9, opacity=opacity)
    body, colour = (wire, metal) if frame.metal else (acetate, plastic)
    arm, arm_colour = (acetate, plastic) if frame.brow else (body, colour)
    edge = Material("lens edge", (0.55, 0.6, 0.62), label=GLASSES, gloss=0.6, opacity=0.45)
    looks = {
        "lens": (glass, pane),
        "rim": (colour, body),
        "edge": (edge.base_color, edge),
        "brow": (plastic, acetate),
        "pad": (PAD, Material("pads", PAD, label=GLASSES, gloss=0.4)),
        "wire": (colour, body),
        "temple": (arm_colour, arm),
    }
    shapes = fit.once(("glasses", style, size, over), lambda: _shapes(face, frame, size, over))
    parts = [Part(shape, *looks[what]) for what, shape in shapes]
    if not frame.metal and rng.random() < 0.3 and luminance(plastic) < 0.5:
        patches = int(rng.integers(1 << 31))
        parts = [_tortoise(part, patches) if part.material is acetate else part for part in parts]
    return face.back(assemble(parts))


def _shapes(face: Face, frame: Frame, size: float, over: float) -> list[tuple[str, Shape]]:
    """What glasses are made of, whatever colours they have."""
    front, outline = seat(face, frame, size, over)
    made: list[tuple[str, Shape]] = []
    for side in (-1, 1):
        # The outline is that of image right; its mirror image turns the other way.
        own = outline if side > 0 else (outline * [-1, 1])[::-1]
        made.append(("lens", lens(front, own)))
        made.append(("rim" if frame.rim_mm[0] else "edge", rim(front, own, frame)))
        if frame.brow:
            made.append(("brow", rim(front, own, frame, upper=True)))
        pad, *wires = pads(face, front, outline, side, frame)
        made += [("pad", pad), *(("wire", shape) for shape in wires)]
        made.append(("temple", temple(face, front, outline, side, frame)))
    made += [("wire", shape) for shape in bridge(face, front, outline, frame)]
    return made


def _tortoise(part: Part, seed: int) -> Part:
    rng = np.random.default_rng(seed)
    colours = mottled(part.shape.vertices, (0.55, 0.33, 0.13), (0.12, 0.07, 0.04), rng, 16.0)
    return Part(part.shape, colours, part.material)


def seat(face: Face, frame: Frame, size: float, over: float = 0.0) -> tuple[Front, np.ndarray]:
    """Where a frame's front stands, and the outline of its lens at image right about the front's middle.

    over: mm that it stands farther from the face, such as over a mask.
    The bridge is chosen that lets the lenses stand nearest to the eyes; over raised cheeks they stand higher.
    Raises CannotWear where even so they are too far.
    """
    (nose,) = face.at(NASION)
    right, left = face.pupil(-1), face.pupil(1)
    middle = np.array([(right[0] + left[0]) / 2, (right[1] + left[1]) / 2 - 1.5, 0.0])
    middle[0] = 0.7 * middle[0] + 0.3 * nose[0]
    apart = float(left[0] - right[0])
    eyes = face.front(np.array([right[0], left[0]]), np.array([right[1], left[1]]))
    if not np.isfinite(eyes).all():
        raise CannotWear("no eye is found for glasses to stand before")
    best: tuple[float, float, np.ndarray, np.ndarray] | None = None
    for up, gap in product(UP_MM, GAPS_MM):
        if up and best is not None and best[1] - eyes.max() <= MOST_VERTEX_MM:
            break
        place = middle + np.array([0.0, up, 0.0])
        gap *= face.scale
        # A lens is wider on a wide nose, too, and its middle farther out.
        centre = apart / 2 + (2.0 + frame.widen_mm / 2) * face.scale + 0.25 * (gap - GAPS_MM[0])
        shape = frame.points(2 * centre * size - gap)
        low = shape[:, 1].min()
        outline = shape + np.array([gap / 2 - shape[:, 0].min(), -0.08 * (shape[:, 1].max() - low)])
        front = Front(place)
        behind = front.at(outline.mean(axis=0))[2]
        needed = max(_needed(face, front, outline, frame) + over, eyes.max() + VERTEX_MM - behind)
        cost = needed + 0.25 * abs(gap - 18.0)
        if best is None or cost < best[0]:
            best = cost, needed, outline, place
    assert best is not None, "there are widths"
    _, depth, outline, place = best
    if depth - eyes.max() > MOST_VERTEX_MM:
        raise CannotWear(f"glasses would stand {depth - eyes.max():.0f} mm before the eyes")
    return Front(place + np.array([0, 0, depth])), outline


def _needed(face: Face, front: Front, outline: np.ndarray, frame: Frame) -> float:
    """The depth of the front's middle at which nothing of it is in the face."""
    centre = outline.mean(axis=0)
    out = outline[::2] - centre
    wide = frame.rim_mm[1] / 2 / np.linalg.norm(out, axis=1, keepdims=True)
    rings = np.stack([out * share for share in (1 + wide, 1.0, 1 - wide, 0.8, 0.55, 0.25)])
    thick = frame.depth_mm / 2 + FREE_MM
    room = np.array([thick, thick, thick, LENS_FREE_MM, LENS_FREE_MM, LENS_FREE_MM])[:, None]
    points = front.at(np.stack([(centre + rings) * [side, 1] for side in (-1, 1)]))
    return float(np.nanmax(face.front(points[..., 0], points[..., 1]) - points[..., 2] + room))


KIND = Kind(make, minds=("lenses", "mask"))
