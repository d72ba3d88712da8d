# SPDX-License-Identifier: GPL-3.0-or-later
"""From ICT-FaceKit's neutral face onto MakeHuman's base mesh, where paint is defined.

A thin-plate spline (Duchon 1977) through corresponding points: of the face the 68 landmarks of Multi-PIE,
whose vertices the source itself names; of the skull what lies in the same direction from its middle; of
the ears their outermost, uppermost and rearmost points.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RBFInterpolator

from generator.errors import HeadError
from generator.geometry.rigid import Similarity, fit_similarity
from generator.heads.ict.mesh import PARTS, IctMesh
from generator.heads.ict.source import ADDRESS, LANDMARKS_FILE, NEUTRAL_FILE
from generator.heads.parametric.template import PARTS as TEMPLATE_PARTS
from generator.heads.parametric.template import head_template

# Where landmarks lie on the base mesh, dm: of the subject's left and the middle, by number of the left one.
_PLACES = {
    8: (0.0, 6.205, 1.437),  # chin
    22: (0.118, 7.478, 1.521), 23: (0.225, 7.508, 1.502), 24: (0.360, 7.520, 1.449),  # brow, upper edge
    25: (0.455, 7.508, 1.385), 26: (0.535, 7.458, 1.278),
    27: (0.0, 7.320, 1.506), 28: (0.0, 7.185, 1.541), 29: (0.0, 7.058, 1.613), 30: (0.0, 6.915, 1.681),
    33: (0.0, 6.797, 1.567), 34: (0.062, 6.802, 1.552), 35: (0.128, 6.811, 1.510),  # below the nose
    42: (0.205, 7.275, 1.346), 43: (0.285, 7.320, 1.366), 44: (0.383, 7.321, 1.352),  # lids
    45: (0.434, 7.281, 1.308), 46: (0.381, 7.252, 1.346), 47: (0.281, 7.249, 1.357),
    51: (0.0, 6.699, 1.596), 52: (0.073, 6.715, 1.588), 53: (0.173, 6.690, 1.527),  # lips without
    54: (0.256, 6.618, 1.434), 55: (0.182, 6.536, 1.478), 56: (0.105, 6.506, 1.523), 57: (0.0, 6.488, 1.549),
    62: (0.0, 6.620, 1.511), 63: (0.108, 6.621, 1.491), 64: (0.246, 6.614, 1.377),  # and within
    65: (0.106, 6.611, 1.489), 66: (0.0, 6.612, 1.510),
}  # fmt: skip

_MIRRORED = {
    **{9 + k: 7 - k for k in range(8)},
    **{22 + k: 21 - k for k in range(5)},
    34: 32, 35: 31,
    42: 39, 43: 38, 44: 37, 45: 36, 46: 41, 47: 40,
    52: 50, 53: 49, 54: 48, 55: 59, 56: 58, 63: 61, 64: 60, 65: 67,
}  # fmt: skip
"""The subject's right landmark of each left one."""

_JAW = range(9, 17)
_MIDDLE = np.array([0.0, 7.25, 0.45])
"""Of the skull, from where directions are the same."""

_SKULL_POINTS = 90
_MAX_RMS = 0.12
"""Of landmarks from their places, dm, by a similarity; those of the published face are off by 0.03."""


@dataclass(frozen=True)
class Warp:
    """points float64 [V, 3]: canonical position, dm, of every vertex of the mesh.

    nearest: the similarity, from cm to dm, that is most like it.
    """

    points: np.ndarray
    nearest: Similarity

    def near(self, vertices: np.ndarray) -> np.ndarray:
        """Vertices [N, 3] in cm as the similarity puts them, dm."""
        return self.nearest.scale * vertices @ self.nearest.rotation.T + self.nearest.translation

    def back(self, points: np.ndarray) -> np.ndarray:
        """The inverse of :meth:`near`."""
        return (points - self.nearest.translation) @ self.nearest.rotation / self.nearest.scale


def warp_onto_base(mesh: IctMesh) -> Warp:
    """The warp of a mesh. A second. Raises HeadError: its landmarks are no face."""
    try:
        return _warp(mesh)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise HeadError(
            f"the landmarks of {LANDMARKS_FILE} are no face on {NEUTRAL_FILE} ({error}); take ICT-FaceKit as "
            f"{ADDRESS} has it"
        ) from error


def _warp(mesh: IctMesh) -> Warp:
    numbers, wanted = landmark_places()
    face = mesh.neutral[mesh.landmarks[numbers]]
    nearest = fit_similarity(face, wanted)
    if nearest.rms > _MAX_RMS:
        raise ValueError(f"{nearest.rms:.2f} dm from where they are on any face")
    rough = Warp(mesh.neutral, nearest).near(mesh.neutral)

    chosen = _around_skull(mesh, rough)
    jaw = mesh.landmarks[[*_JAW, *(_MIRRORED[k] for k in _JAW)]]
    outer = np.concatenate([jaw, chosen])
    onto = _in_direction(rough[outer])
    hit = np.isfinite(onto).all(1)
    ears, ears_onto = _ears(mesh, rough)
    places = np.concatenate([face, mesh.neutral[outer[hit]], mesh.neutral[ears]])
    targets = np.concatenate([wanted, onto[hit], ears_onto])
    _, first = np.unique(places.round(6), axis=0, return_index=True)
    spline = RBFInterpolator(places[first], targets[first], kernel="thin_plate_spline", smoothing=1e-3)
    return Warp(spline(mesh.neutral), nearest)


def landmark_places() -> tuple[np.ndarray, np.ndarray]:
    """Numbers [N] of landmarks and where they lie [N, 3] dm, both sides."""
    numbers, points = list(_PLACES), list(_PLACES.values())
    for left, right in _MIRRORED.items():
        if left in _PLACES:
            numbers.append(right)
            points.append(_PLACES[left])
    places = np.array(points)
    places[len(_PLACES) :, 0] *= -1
    return np.array(numbers), places


def _around_skull(mesh: IctMesh, rough: np.ndarray) -> np.ndarray:
    """Vertices all over skull, jaw and neck but face and ears: each the farthest from those before."""
    skin = np.unique(mesh.triangles[mesh.of_part("skin")])
    skin = skin[skin < len(mesh.vertices)]
    x, y, z = rough[skin].T
    face = (z > 0.95) & (y < 7.72)
    ear = (np.abs(x) > 0.55) & (y > 6.6) & (y < 7.6) & (z > 0.1) & (z < 0.9)
    rest = skin[(y > 6.25) & ~face & ~ear]
    if not len(rest):
        return rest
    points = rough[rest]
    taken = [int(points[:, 1].argmax())]
    away = np.full(len(rest), np.inf)
    while len(taken) < min(_SKULL_POINTS, len(rest)):
        away = np.minimum(away, ((points - points[taken[-1]]) ** 2).sum(1))
        taken.append(int(away.argmax()))
    return rest[taken]


def _in_direction(points: np.ndarray) -> np.ndarray:
    """The outermost point of the base mesh's skin in the direction of each point [N, 3]; nan where none is.

    Möller and Trumbore 1997.
    """
    template = head_template()
    skin = template.triangles[template.part == TEMPLATE_PARTS.index("skin")]
    a, b, c = template.canonical[skin].transpose(1, 0, 2)
    ab, ac, start = b - a, c - a, _MIDDLE - a
    onto = np.full(points.shape, np.nan)
    for k, way in enumerate(points - _MIDDLE):
        across = np.cross(way, ac)
        size = (across * ab).sum(1)
        with np.errstate(divide="ignore", invalid="ignore"):
            u = (across * start).sum(1) / size
            turned = np.cross(start, ab)
            v = turned @ way / size
            t = (turned * ac).sum(1) / size
        hit = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9) & (t > 0)
        if hit.any():
            onto[k] = _MIDDLE + t[hit].max() * way
    return onto


def _ears(mesh: IctMesh, rough: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices of the ears' far ends, and where these lie on the base mesh [N, 3]."""
    template = head_template()
    base = template.canonical[np.unique(template.triangles[template.part == TEMPLATE_PARTS.index("skin")])]
    skin = np.unique(mesh.triangles[mesh.part == PARTS.index("skin")])
    ours, theirs = [], []
    for side in (-1, 1):
        vertices, points = _ear(rough[skin], side), _ear(base, side)
        if len(vertices) and len(points):
            ours += skin[vertices].tolist()
            theirs += base[points].tolist()
    return np.array(ours, dtype=np.int64), np.array(theirs).reshape(-1, 3)


def _ear(points: np.ndarray, side: int) -> np.ndarray:
    """Of points [N, 3] on a head: the outermost, uppermost and rearmost of an ear."""
    x, y, z = points.T
    x = side * x
    region = np.flatnonzero((x > 0.55) & (y > 6.7) & (y < 7.5) & (z > 0.2) & (z < 0.95))
    if not len(region):
        return region[:0]
    outermost = region[x[region].argmax()]
    ear = region[x[region] > x[outermost] - 0.07]
    return np.array([outermost, ear[y[ear].argmax()], ear[z[ear].argmin()]])
