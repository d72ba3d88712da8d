# SPDX-License-Identifier: GPL-3.0-or-later
"""From weights of ICT-FaceKit's modes to the vertices of one head."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.heads.ict.atlas import Surface
from generator.heads.ict.mesh import eye_frame
from generator.heads.ict.source import EXPRESSIONS, IDENTITIES, MODES, FaceKit
from generator.heads.parametric.appearance import Appearance
from generator.heads.parametric.curtain import curtain_vertices
from generator.heads.parametric.expression import NEUTRAL_EXPRESSION, Expression
from generator.heads.parametric.hair import hair_lift
from generator.heads.parametric.noise import smoothstep
from generator.heads.triangles import vertex_normals

WEIGHT_LIMIT = 2.5
"""Identity weights come from the standard normal distribution and stay within this."""

_PLACE_KEYS = np.array([1, 2_654_435_761, 40_503 * 2**40 + 1])
MM_PER_CM, MM_PER_DM = 10.0, 100.0


_SEAM = 6.6155
"""Canonical height, dm, at which the lips meet; see the places of generator.heads.ict.warp."""

_GAP_AT = np.array([-0.246, -0.108, 0.0, 0.108, 0.246])
"""Canonical x, dm, of the corners of the mouth and of the three pairs of landmarks between them."""

_OVERLAP = 0.06
"""By which the lips are pressed together, cm, as the line between landmarks is not straight."""

_UPPER_LIP, _LOWER_LIP = (61, 62, 63), (67, 66, 65)


@dataclass(frozen=True)
class IctShape:
    """One identity, ready to take any expression: vertices in cm, frame U.

    source: [K, 3] of the source's vertices that are drawn. hair: [V, 3] mm offsets.
    curtain: [C, 3] cm, the sheet of long hair, or None.
    """

    source: np.ndarray
    hair: np.ndarray
    curtain: np.ndarray | None


def sample_weights(rng: np.random.Generator) -> np.ndarray:
    """Weights [100] of the identity modes."""
    weights = rng.standard_normal(len(IDENTITIES))
    while (far := np.abs(weights) > WEIGHT_LIMIT).any():
        weights[far] = rng.standard_normal(int(far.sum()))
    return weights


def expression_modes(expression: Expression) -> dict[str, float]:
    """Mode -> weight of an expression's face units. What has no counterpart among the modes is left out."""
    weights: dict[str, float] = {}
    for unit, value in (expression.units or {}).items():
        name = unit
        for side in ("Left", "Right"):
            if unit.endswith(side) and f"{unit.removesuffix(side)}_{side[0]}" in EXPRESSIONS:
                name = f"{unit.removesuffix(side)}_{side[0]}"
        for mode in (name, f"{name}_L", f"{name}_R"):
            if mode in EXPRESSIONS and value:
                weights[mode] = value
    return weights


def head_shape(
    kit: FaceKit, surface: Surface, weights: np.ndarray, look: Appearance, rng: np.random.Generator
) -> IctShape:
    """Everything about a head that its expressions share."""
    mesh = surface.mesh
    sum_of_modes = kit.neutral.copy()
    # One by one: a product of matrices adds in an order that is the machine's.
    for weight, mode in zip(weights, kit.modes, strict=False):
        sum_of_modes += weight * mode
    source = sum_of_modes[mesh.vertices]
    source += _lips_together(surface, source)
    vertices = mesh.close(source)
    skin = mesh.triangles[mesh.of_part("skin")]
    lift = hair_lift(surface.warp.points, surface.ear_distance, look, rng)
    lift[~np.isin(np.arange(len(lift)), skin)] = 0
    hair = vertex_normals(vertices, skin)[0] * lift[:, None] * MM_PER_DM
    curtain = None
    if look.hair_style == "long":
        template = surface.warp.near(vertices)[surface.of_template]
        curtain = surface.warp.back(curtain_vertices(template, look, rng))
    return IctShape(source, hair, curtain)


def _lips_together(surface: Surface, source: np.ndarray) -> np.ndarray:
    """Offsets [K, 3] cm that close the lips of a neutral head, which many sums of modes part."""
    mesh = surface.mesh
    upper, lower = (source[mesh.landmarks[list(lip)], 1] for lip in (_UPPER_LIP, _LOWER_LIP))
    gap = np.concatenate([[_OVERLAP], np.maximum(upper - lower, 0) + _OVERLAP, [_OVERLAP]])
    x, y, _ = surface.warp.points.T[:, :-1]
    # Each lip moves by half, near the line where they meet most.
    side = np.clip((_SEAM - y) / 0.004, -1, 1) * smoothstep(0.22, 0.09, surface.lip_distance[:-1])
    offsets = np.zeros(source.shape)
    offsets[:, 1] = 0.5 * side * np.interp(x, _GAP_AT, gap)
    return offsets


def head_vertices(
    kit: FaceKit, surface: Surface, shape: IctShape, expression: Expression = NEUTRAL_EXPRESSION
) -> np.ndarray:
    """Vertices float64 [N, 3], mm, frame U: the mesh's, then long hair."""
    mesh = surface.mesh
    moved = shape.source.copy()
    for mode, weight in expression_modes(expression).items():
        moved += weight * kit.modes[MODES.index(mode)][mesh.vertices]
    turn = gaze_rotation(expression.gaze_right_deg, expression.gaze_up_deg)
    for eye in mesh.eyes:
        centre, _ = eye_frame(shape.source[eye])
        moved[eye] = centre + (moved[eye] - centre) @ turn.T
    vertices = mesh.close(moved) * MM_PER_CM + shape.hair
    curtain = [] if shape.curtain is None else [shape.curtain * MM_PER_CM]
    return apart(np.concatenate([vertices, *curtain]))


def apart(vertices: np.ndarray) -> np.ndarray:
    """Vertices [N, 3] mm to the micrometre, no two at one place: a reader would take them for one, and the
    triangles of this head for others than those of the next."""
    whole = np.rint(vertices * 1000).astype(np.int64)
    while True:
        # Another place may rarely have the same number; then a vertex moves by a micrometre for nothing.
        _, first = np.unique(whole @ _PLACE_KEYS, return_index=True)
        again = np.ones(len(whole), dtype=bool)
        again[first] = False
        if not again.any():
            return whole / 1000
        whole[again, 1] -= 1


def gaze_rotation(right_deg: float, up_deg: float) -> np.ndarray:
    """[3, 3] that turns +z right_deg to +x and up_deg to +y."""
    yaw, pitch = np.deg2rad([right_deg, -up_deg])
    turn_x = np.array([[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]])
    turn_y = np.array([[np.cos(yaw), 0, np.sin(yaw)], [0, 1, 0], [-np.sin(yaw), 0, np.cos(yaw)]])
    return turn_y @ turn_x
