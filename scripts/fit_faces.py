# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit parametric heads to figures of real-shaped faces: their mean, and how they vary.

    python scripts/fit_faces.py FIGURES.npz            # print, fit, write real_shape.npz, print again
    python scripts/fit_faces.py FIGURES.npz --check    # only print

FIGURES.npz: ``points_mm`` [N, 468, 3], where Face Mesh's points lie on level faces, frame U, and
``has_expression`` [N]; those of ICT-FaceKit (MIT, USC Institute for Creative Technologies) were used.
Faces are compared about their centroid in RMS radii, axes as they are. Only smooth fields on
MakeHuman's base mesh are stored, fitted to the mean and the principal components of all of them.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from scipy.sparse import csr_matrix
from scipy.spatial import cKDTree

from generator.heads.parametric.atlas import head_atlas, vertex_normals
from generator.heads.parametric.eyes import fit_eyeball
from generator.heads.parametric.folder import head_triangles
from generator.heads.parametric.identity import (
    apply_targets,
    base_vertices,
    head_target,
    identity_vertices,
    levelled,
    macro_weights,
    sample_identity,
)
from generator.heads.parametric.noise import smoothstep
from generator.heads.parametric.real_shape import PREFIX, write_real_shape
from generator.heads.parametric.source import base_mesh
from generator.heads.parametric.template import PARTS, head_template, neck_height
from generator.landmarks.shared import packaged
from generator.landmarks.topology import FACE_MESH

MODES = 12
SAMPLES = 400
SPREAD = 0.8
"""Of the figures' own: what the factors bring heads to along each component, where sex, age, ethnicity
and details alone vary less."""

MIRROR = np.array([-1.0, 1.0, 1.0])
LEAST_FACING = 0.1
"""A point on skin turned away from the viewer is found less surely along it: by the cosine, down to this."""

REACH_DM = 0.75
"""How far from the points of the face a correction has died away to a third, about."""

LEAST_DM = 5e-5
"""Vertices that never move farther are not stored."""

LIPS_DM = 0.2
"""How far around the line between the lips the skin goes with it, less and less."""

EYES = (
    *(33, 7, 163, 144, 145, 153, 154, 155, 133, 173, 157, 158, 159, 160, 161, 246),
    *(263, 249, 390, 373, 374, 380, 381, 382, 362, 398, 384, 385, 386, 387, 388, 466),
)
INNER_LIPS = (78, 191, 80, 81, 82, 13, 312, 311, 310, 415, 308, 324, 318, 402, 317, 14, 87, 178, 88, 95)
EDGE_SLIP = 4.0
"""Where lips meet and lids end, points lie on either side or on the eye."""

EAR_FADE_DM = 0.35
"""How far around an ear the cheek goes with it, less and less: nearer there would be an edge."""

EAR_SLIP = 3.0
"""Points on that cheek cannot have their way: the ear has one of its own."""

LINING_DM = 0.06
"""How widely the edges of lips and lids are averaged for what lies behind them."""

FINE_DM, FINE_SHARE = 0.25, 0.02
NOISE, MEAN_NOISE = 0.03, 0.006
"""How far a point may be off, as a share of the size of the correction: detections slip along cheeks."""


@dataclass(frozen=True)
class Figures:
    """Real-shaped neutral faces. mean [468, 3]; components [M, 1404], unit; deviations [M]."""

    mean: np.ndarray
    components: np.ndarray
    deviations: np.ndarray


def read_figures(path: Path) -> Figures:
    """Mean and principal components of the neutral faces of a file."""
    with np.load(path, allow_pickle=False) as stored:
        faces = normalised(stored["points_mm"][~stored["has_expression"]].astype(np.float64))
    mean = faces.mean(0)
    _, singular, rows = np.linalg.svd((faces - mean).reshape(len(faces), -1), full_matrices=False)
    return Figures(mean, rows[:MODES], singular[:MODES] / np.sqrt(len(faces) - 1))


def normalised(points: np.ndarray) -> np.ndarray:
    """Points [..., 468, 3] about their centroid, in RMS radii."""
    centred = points - points.mean(-2, keepdims=True)
    return centred / np.sqrt((centred**2).sum(-1).mean(-1))[..., None, None]


def landmark_places() -> csr_matrix:
    """Where the 468 points lie on every head, as weights of its source vertices, sparse [468, S]."""
    template = head_template()
    [shared] = packaged(FACE_MESH)
    triangles, _, materials = head_triangles(long_hair=False)
    as_written = np.concatenate([np.flatnonzero(materials == name) for name in ("skin", "eye", "lash")])
    corners = triangles[as_written[shared.anchors.triangles]]
    if corners.max() >= len(template.canonical):
        raise SystemExit("a point lies on an eyeball: run scripts/make_anchors.py again")
    rows = np.repeat(np.arange(len(corners)), 3)
    shape = (len(corners), len(template.canonical))
    places = csr_matrix((shared.anchors.weights.ravel(), (rows, corners.ravel())), shape=shape)
    return csr_matrix(places @ template.refine)


def sampled(*, plain: bool = False) -> np.ndarray:
    """Source vertices of identities [SAMPLES, S, 3], dm; plain: as MakeHuman's alone make them."""
    people = (sample_identity(np.random.default_rng([5, index, 0])) for index in range(SAMPLES))
    if not plain:
        return np.array([identity_vertices(person) for person in people])
    heads = []
    for person in people:
        own = {name: weight for name, weight in person.targets.items() if not name.startswith(PREFIX)}
        heads.append(apply_targets(plain_base(), macro_weights(person) | own))
    return np.array(heads)


def plain_base() -> np.ndarray:
    """MakeHuman's base mesh in source numbering, float64 [S, 3] dm."""
    return base_mesh().vertices[head_template().source_vertices]


def report(title: str, points: np.ndarray, figures: Figures) -> None:
    """Print how far heads' points [N, 468, 3] are from the figures."""
    faces = normalised(points)
    mean = faces.mean(0)
    off = np.sqrt(((mean - figures.mean) ** 2).sum(1).mean())
    scores = (faces - mean).reshape(len(faces), -1) @ figures.components.T
    ratios = scores.std(0, ddof=1) / figures.deviations
    print(f"{title}: mean off by {off:.4f} RMS radii; spread", *(f"{ratio:.2f}" for ratio in ratios))


class Fields:
    """Smooth fields of offsets over the head that follow offsets of the 468 points.

    A Gaussian process (Rasmussen and Williams, 2006, Eq. 2.25) of two Matern kernels: it dies away from
    the face by itself, is held at neck and skull, and takes what contradicts its neighbours for noise.

    head: float [S, 3] dm, source vertices of the mean head, mirror-symmetric. places: see landmark_places.
    """

    def __init__(self, head: np.ndarray, places: csr_matrix, noise: float) -> None:
        template = head_template()
        self._head, self._places = head, places
        points = places @ head
        base = plain_base()
        skull = (base[:, 2] < 0.0) & (base[:, 1] > 7.0) | (base[:, 1] > 8.35)
        rim = (np.abs(neck_height(base)) < 0.12) | skull
        rim &= np.isin(np.arange(len(base)), template.refine.indices)
        held = head[rim][::4]
        at = np.concatenate([points, held])
        slip = np.ones(len(at))
        slip[: len(points)] = 1 / np.maximum(self._facing(), LEAST_FACING)
        slip[[*INNER_LIPS, *EYES]] *= EDGE_SLIP
        slip[: len(points)][places @ sum(_ears()) > 0.02] *= EAR_SLIP
        kernel = _kernel(at, at) + np.diag((noise * slip) ** 2)
        self._weights = np.linalg.solve(kernel, _kernel(at, head))[: len(points)].T
        self._eyes = [fit_eyeball(head[helper]) for helper in template.eye_vertices]

    def _facing(self) -> np.ndarray:
        """How far the skin at each point is turned to the viewer, cosine [468]."""
        template = head_template()
        skin = template.triangles[template.part == PARTS.index("skin")]
        normals, _ = vertex_normals(template.refine @ self._head, skin)
        rows = (self._places @ self._head)[:, None] - (template.refine @ self._head)[None]
        return normals[(rows**2).sum(2).argmin(1), 2]

    def over_head(self, offsets: np.ndarray) -> np.ndarray:
        """Offsets [S, 3] of the source vertices that follow those of the points [468, 3], dm."""
        moved = self._weights @ offsets
        template = head_template()
        for eye, helper in zip(self._eyes, template.eye_vertices, strict=True):
            # The eyeball keeps its shape, and lids keep their distance to it.
            front = eye.centre + np.array([0.0, 0.0, eye.radius])
            near = np.exp(-(((self._head - front) / 0.25) ** 2).sum(1))
            drift = (near[:, None] * moved).sum(0) / near.sum()
            way = self._head - eye.centre
            distance = np.linalg.norm(way, axis=1, keepdims=True)
            outward = way / np.maximum(distance, 1e-9)
            beside = moved - drift
            close = smoothstep(0.16, 0.03, np.abs(distance - eye.radius))
            close = close * smoothstep(-0.1, 0.1, way[:, 2:])
            moved -= close * (beside * outward).sum(1, keepdims=True) * outward
            moved[helper] = drift
        for inside, edge, reach in _linings():
            # What lies behind lips and lids goes with their edges, so that it never comes through,
            # and lips keep their thickness.
            squared = ((self._head[:, None] - self._head[edge][None]) ** 2).sum(2)
            least = squared.min(1, keepdims=True)
            near = np.exp((least - squared) / (2 * LINING_DM**2))
            with_edge = near @ moved[edge] / near.sum(1, keepdims=True)
            share = smoothstep(reach, 0.2 * reach, np.sqrt(least)) if reach else np.zeros_like(least)
            share[inside] = 1
            moved += share * (with_edge - moved)
        for ear in _ears():
            # Of one piece: what is known of its root would be exaggerated by its reach.
            border = ear * (1 - ear)
            root = (border[:, None] * moved).sum(0) / border.sum()
            moved += ear[:, None] * (root - moved)
        return moved


def _kernel(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Covariance of the offsets of points [N, 3] and [M, 3], float [N, M]."""
    distance = np.sqrt(((a[:, None] - b[None]) ** 2).sum(2))

    def matern(reach: float) -> np.ndarray:
        r = np.sqrt(5) * distance / reach
        return (1 + r + r**2 / 3) * np.exp(-r)

    return matern(REACH_DM) + FINE_SHARE * matern(FINE_DM)


@lru_cache(maxsize=1)
def _ears() -> tuple[np.ndarray, ...]:
    """How much each source vertex belongs to the left and the right ear, 0-1 [S]."""
    atlas, base = head_atlas(), plain_base()
    away = cKDTree(atlas.points[atlas.ears > 0.5]).query(base)[0]
    share = smoothstep(EAR_FADE_DM, 0.0, away)
    return tuple(share * (np.sign(base[:, 0]) == side) for side in (1, -1))


@lru_cache(maxsize=1)
def _linings() -> tuple[tuple[np.ndarray, np.ndarray, float], ...]:
    """Source vertices of mouth, teeth and tongue, those between the lips and how far skin goes with them;
    of each socket, its lids, and 0.
    """
    template = head_template()

    def rows(vertices: np.ndarray) -> np.ndarray:
        return np.unique(template.refine[np.unique(vertices)].indices)

    def of(*names: str) -> np.ndarray:
        return rows(template.triangles[np.isin(template.part, [PARTS.index(name) for name in names])])

    skin = of("skin")
    mouth = np.setdiff1d(of("mouth", "upper_teeth", "lower_teeth", "tongue"), skin)
    linings = [(mouth, rows(template.lip_margin), LIPS_DM)]
    for side in ("socket_left", "socket_right"):
        linings.append((np.setdiff1d(of(side), skin), np.intersect1d(of(side), skin), 0.0))
    return tuple(linings)


@lru_cache(maxsize=1)
def mirror_vertices() -> np.ndarray:
    """The source vertex at the mirrored place of each, int [S]."""
    base = base_mesh().vertices[head_template().source_vertices]
    distance, mirrored = cKDTree(base).query(base * MIRROR)
    if distance.max() > 1e-3 or (mirrored[mirrored] != np.arange(len(base))).any():
        raise SystemExit("the base mesh is not mirror-symmetric")
    return mirrored


def symmetric(offsets: np.ndarray) -> np.ndarray:
    """Mean of offsets or places [S, 3] and their mirror image."""
    return (offsets + offsets[mirror_vertices()] * MIRROR) / 2


def fit(figures: Figures, places: csr_matrix) -> tuple[np.ndarray, np.ndarray]:
    """Correction [S, 3] and targets [M, S, 3], dm, of source vertices, for heads without either."""
    heads = sampled(plain=True)
    heads = np.array([levelled(head, plain_base()) for head in heads])
    head = symmetric(heads.mean(0))
    pairs = FACE_MESH.mirror_pairs()

    def field(fields: Fields, offsets: np.ndarray) -> np.ndarray:
        return symmetric(fields.over_head((offsets + offsets[pairs] * MIRROR) / 2))

    points = places @ head
    centred = points - points.mean(0)
    size = (centred * figures.mean).sum() / (figures.mean**2).sum()
    for_mean, for_modes = Fields(head, places, MEAN_NOISE), Fields(head, places, NOISE)
    correction = np.zeros_like(head)
    for _ in range(6):
        corrected = normalised(np.einsum("ps,nsd->npd", places.toarray(), heads + correction))
        correction = correction + field(for_mean, size * (figures.mean - corrected.mean(0)))
    corrected = normalised(np.einsum("ps,nsd->npd", places.toarray(), heads + correction))
    scores = (corrected - corrected.mean(0)).reshape(len(heads), -1) @ figures.components.T
    missing = np.diag((SPREAD * figures.deviations) ** 2) - np.cov(scores.T)
    values, vectors = np.linalg.eigh(missing)
    wanted = vectors * np.sqrt(np.maximum(values, 0))  # a column a factor
    raw = np.array([field(for_modes, size * row.reshape(-1, 3)) for row in figures.components])
    centre = head + correction
    step = 0.05
    effect = np.array([normalised(places @ (centre + step * f)) - normalised(places @ centre) for f in raw])
    reached = effect.reshape(MODES, -1) @ figures.components.T / step  # row: field, column: component
    print("of each component, a field alone reaches", *(f"{v:.2f}" for v in np.diag(reached)))
    targets = np.tensordot(np.linalg.solve(reached.T, wanted).T, raw, axes=1)
    return correction, targets[np.argsort(-values)]


def main() -> None:
    """Print, and unless only checking fit, write and print again."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("figures", type=Path)
    parser.add_argument("--check", action="store_true", help="only print")
    given = parser.parse_args()
    figures, places = read_figures(given.figures), landmark_places()

    def figures_now(title: str) -> None:
        report(title, np.einsum("ps,nsd->npd", places.toarray(), sampled()), figures)

    figures_now("heads as they are")
    if given.check:
        return
    correction, targets = fit(figures, places)
    moved = np.abs(np.concatenate([correction[None], targets])).max((0, 2)) > LEAST_DM
    vertices = head_template().source_vertices[moved]
    write_real_shape(vertices, correction[moved], targets[:, moved])
    base_vertices.cache_clear()
    head_target.cache_clear()
    figures_now("heads as fitted")


if __name__ == "__main__":
    main()
