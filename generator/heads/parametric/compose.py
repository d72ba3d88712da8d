# SPDX-License-Identifier: GPL-3.0-or-later
"""From parameters to the vertices of one head: shape, expression, eyes, lashes and hair."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

from generator.heads.parametric.appearance import Appearance
from generator.heads.parametric.curtain import curtain_vertices
from generator.heads.parametric.expression import NEUTRAL_EXPRESSION, Expression, expression_targets
from generator.heads.parametric.eyes import Eyeball, eyeball_vertices, fit_eyeball
from generator.heads.parametric.hair import hair_volume
from generator.heads.parametric.identity import Identity, apply_targets, identity_vertices
from generator.heads.parametric.noise import smoothstep
from generator.heads.parametric.template import PARTS, head_template

EYE_DISTANCE_MM = (85.0, 95.0)
"""Width across both eyes at the lids' edges, mm; heads are scaled to lie within.

Face Mesh puts the outer corners about 3 mm farther apart: 87 to 94 mm, as on adults.
"""

LIP_THICKNESS = 0.08
"""Least distance (dm) of the teeth behind the line where the lips meet."""

_LIPS_TOGETHER = 0.007  # MakeHuman's lips hardly touch; many shapes would part them a little.
_CHEEK_ROOM = 0.8  # The mouth's walls keep off the cheeks, which a dropping jaw draws inwards.
_DENTAL_ARCH = 0.86  # MakeHuman's helper teeth are wide enough to pass through thin cheeks.


@dataclass(frozen=True)
class HeadShape:
    """One identity, ready to take any expression.

    source: [S, 3] dm, source numbering. origin [3] dm: eye height, between the ears.
    scale: mm per dm. hair: [V, 3] dm offsets. teeth_back: dm.
    eyes: left and right.
    curtain: [C, 3] dm, the sheet of long hair, or None.
    """

    identity: Identity
    appearance: Appearance
    source: np.ndarray
    origin: np.ndarray
    scale: float
    hair: np.ndarray
    teeth_back: float
    eyes: tuple[Eyeball, Eyeball]
    curtain: np.ndarray | None


def head_shape(identity: Identity, appearance: Appearance, rng: np.random.Generator) -> HeadShape:
    """Everything about a head that its expressions share."""
    template = head_template()
    source = identity_vertices(identity)
    skin = template.refine @ source
    left, right = (fit_eyeball(source[helper]) for helper in template.eye_vertices)
    distance = 100 * float(np.ptp(skin[template.lid_margin, 0]))
    # MakeHuman's eyes lie slightly closer together than people's: half of the spread is kept.
    wanted = float(np.clip(88 + 0.5 * (distance - 84), *EYE_DISTANCE_MM))
    eye_height = (left.centre[1] + right.centre[1]) / 2
    ears = skin[np.argsort(np.abs(template.canonical[:, 0]), kind="stable")[-40:]]
    origin = np.array([(left.centre[0] + right.centre[0]) / 2, eye_height, ears[:, 2].mean()])
    hair = hair_volume(skin, appearance, rng)
    curtain = curtain_vertices(skin, appearance, rng) if appearance.hair_style == "long" else None
    room = skin[template.lip_margin, 2].max() - skin[_behind_lips(), 2].max()
    return HeadShape(
        identity=identity,
        appearance=appearance,
        source=source,
        origin=origin,
        scale=100 * wanted / distance,
        hair=hair,
        teeth_back=max(0.0, LIP_THICKNESS - float(room)),
        eyes=(left, right),
        curtain=curtain,
    )


def head_vertices(shape: HeadShape, expression: Expression = NEUTRAL_EXPRESSION) -> np.ndarray:
    """Vertices float64 [N, 3], mm, frame U: the template's, the left eye, the right eye, long hair."""
    template = head_template()
    moved = apply_targets(shape.source, expression_targets(expression, shape.identity))
    vertices = template.refine @ moved
    vertices[:, 1] += _LIPS_TOGETHER * _lip_side()
    inner = _behind_lips()
    vertices[inner, 2] -= shape.teeth_back
    vertices[inner, 0] = shape.origin[0] + _DENTAL_ARCH * (vertices[inner, 0] - shape.origin[0])
    cheeks, depth = _inner_cheeks()
    middle = vertices[cheeks].mean(0)
    vertices[cheeks] += depth * (_CHEEK_ROOM - 1) * (vertices[cheeks] - middle)
    roots, tips = vertices[template.lash_roots], vertices[template.lash_vertices]
    vertices[template.lash_vertices] = roots + shape.appearance.lashes * (tips - roots)
    vertices += shape.hair
    gaze = expression.gaze_right_deg, expression.gaze_up_deg
    eyes = [eyeball_vertices(eye, *gaze) for eye in shape.eyes]
    curtain = [] if shape.curtain is None else [shape.curtain]
    return (np.concatenate([vertices, *eyes, *curtain]) - shape.origin) * shape.scale


@lru_cache(maxsize=1)
def _behind_lips() -> np.ndarray:
    """Vertices of teeth and tongue."""
    template = head_template()
    parts = [PARTS.index(name) for name in ("upper_teeth", "lower_teeth", "tongue")]
    return np.unique(template.triangles[np.isin(template.part, parts)])


@lru_cache(maxsize=1)
def _inner_cheeks() -> tuple[np.ndarray, np.ndarray]:
    """Vertices of the mouth's walls [M] and how far behind the lips they are, 0-1 [M, 1]."""
    template = head_template()
    walls = np.unique(template.triangles[template.part == PARTS.index("mouth")])
    lips = cKDTree(template.canonical[template.lip_margin])
    return walls, smoothstep(0.03, 0.25, lips.query(template.canonical[walls])[0])[:, None]


@lru_cache(maxsize=1)
def _lip_side() -> np.ndarray:
    """-1 on the upper lip, 1 on the lower, fading to 0 away from the line where they meet, [V]."""
    template = head_template()
    points, margin = template.canonical, template.lip_margin
    edges = np.concatenate([template.triangles[:, [i, (i + 1) % 3]] for i in range(3)])
    pairs = np.unique(np.sort(edges, axis=1), axis=0)
    length = np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1)
    graph = csr_matrix((length, pairs.T), shape=(len(points),) * 2)
    away, _, nearest = dijkstra(
        graph, directed=False, indices=margin, limit=0.2, min_only=True, return_predecessors=True
    )
    middle = np.median(points[margin, 1])
    side = np.zeros(len(points))
    near = np.isfinite(away)
    side[near] = np.clip((middle - points[nearest[near], 1]) / 0.006, -1, 1)
    return side * smoothstep(0.15, 0.03, np.where(near, away, 1.0))
