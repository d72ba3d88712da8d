# SPDX-License-Identifier: GPL-3.0-or-later
"""A set of landmarks: how many, which is which, and what they look like on a mean face.

numpy only: whoever reads a dataset needs this, and neither a detector nor a renderer.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from importlib.resources import files
from itertools import chain

import numpy as np


@dataclass(frozen=True, eq=False)
class PointSubset:
    """Points of another scheme, picked from a topology.

    groups: name of a part of the face -> places of its points in the topology, all in the scheme's
        order. closed: parts whose line goes back to its start.
    """

    name: str
    groups: Mapping[str, tuple[int, ...]]
    closed: frozenset[str] = frozenset()

    @cached_property
    def indices(self) -> np.ndarray:
        """int64 [K]: place in the topology of point i of the scheme."""
        return np.array(list(chain.from_iterable(self.groups.values())))

    @cached_property
    def names(self) -> tuple[str, ...]:
        """A name a point, in the scheme's order, such as "jaw_1"."""
        return tuple(f"{name}_{k + 1}" for name, group in self.groups.items() for k in range(len(group)))

    @cached_property
    def skeleton(self) -> tuple[tuple[int, int], ...]:
        """Lines between points for drawing, as pairs of places in the scheme, from 0."""
        lines: list[tuple[int, int]] = []
        start = 0
        for name, group in self.groups.items():
            stop = start + len(group)
            lines += [(k, k + 1) for k in range(start, stop - 1)]
            if name in self.closed:
                lines.append((stop - 1, start))
            start = stop
        return tuple(lines)


@dataclass(frozen=True, eq=False)
class Topology:
    """What a detector's points are. P = count.

    name: as datasets record it. right_eye_outer ... nose_tip: places of single points; right is the
        subject's own right, image left.
    parts: name of a part of the face -> places of its points; the whole face need not be named.
    ibug_68: the 68 points of iBUG 300-W among them, or None where there is no such choice.
    reference_csv, surface_csv: files of this package, see :meth:`reference_face`, :meth:`surface_face`.
    level_pitch_deg: pitch of the reference face as a rigid fit of the detector's own model face reads
        it: where that fit reads zero is pose zero "level".
    packaged_anchors: files of this package, see :mod:`generator.landmarks.shared`.
    """

    name: str
    count: int
    right_eye_outer: int
    left_eye_outer: int
    chin: int
    nose_tip: int
    parts: Mapping[str, tuple[int, ...]] = field(default_factory=dict)
    ibug_68: PointSubset | None = None
    reference_csv: str = ""
    surface_csv: str = ""
    level_pitch_deg: float = 0.0
    packaged_anchors: tuple[str, ...] = ()

    @cached_property
    def regions(self) -> dict[str, np.ndarray]:
        """Part of the face -> places of its points, int64 [k]; first "whole face", all of them."""
        parts = {name: np.array(points) for name, points in self.parts.items()}
        return {"whole face": np.arange(self.count), **parts}

    def reference_face(self) -> np.ndarray:
        """The mean of what the detector finds on neutral faces, made symmetric.

        For the detector's landmarks, whose depth is the detector's own idea. float64 [P, 3], mm,
        frame U, centroid at the origin, read-only. Its pose zero is the canonical one; see
        docs/conventions.md. Raises ValueError: the topology has no such face.
        """
        return self._reference

    def surface_face(self) -> np.ndarray:
        """The mean of where those points lie on the surface of the same heads, as :meth:`reference_face`.

        For anchors, which have the true depth.
        """
        return self._surface

    def mirror_pairs(self) -> np.ndarray:
        """Index of each point's mirror partner, int [P], read-only; points of the middle are their own."""
        return self._pairs

    @cached_property
    def _reference(self) -> np.ndarray:
        return self._read(self.reference_csv)

    @cached_property
    def _surface(self) -> np.ndarray:
        return self._read(self.surface_csv)

    @cached_property
    def _pairs(self) -> np.ndarray:
        face = self.reference_face()
        mirrored = face * [-1.0, 1.0, 1.0]
        pairs = np.linalg.norm(mirrored[:, None] - face[None], axis=2).argmin(axis=1)
        if (pairs[pairs] != np.arange(self.count)).any():
            raise ValueError(f"{self.reference_csv}: its points cannot be paired; make it again")
        pairs.setflags(write=False)
        return pairs

    def _read(self, name: str) -> np.ndarray:
        if not name:
            raise ValueError(f"the landmarks {self.name} have no mean face; give their topology its files")
        text = files("generator.landmarks").joinpath(name).read_text(encoding="ascii")
        points = np.loadtxt(text.splitlines(), delimiter=",", comments="#")
        if points.shape != (self.count, 3):
            raise ValueError(f"{name}: expected {self.count} rows of x,y,z, got {points.shape}")
        points.setflags(write=False)
        return points


# The subset in common use. It is symmetric: mirroring the face maps it onto itself. The jaw lies on
# the mesh, not on the outline that a turned face shows.
_IBUG_68 = PointSubset(
    "iBUG 300-W",
    {
        "jaw": (162, 234, 93, 58, 172, 136, 149, 148, 152, 377, 378, 365, 397, 288, 323, 454, 389),
        "right_brow": (71, 63, 105, 66, 107),
        "left_brow": (336, 296, 334, 293, 301),
        "nose_bridge": (168, 197, 5, 4),
        "nose_base": (75, 97, 2, 326, 305),
        "right_eye": (33, 160, 158, 133, 153, 144),
        "left_eye": (362, 385, 387, 263, 373, 380),
        "outer_lips": (61, 39, 37, 0, 267, 269, 291, 405, 314, 17, 84, 181),
        "inner_lips": (78, 82, 13, 312, 308, 317, 14, 87),
    },
    frozenset({"right_eye", "left_eye", "outer_lips", "inner_lips"}),
)

# As MediaPipe's own connection lists draw them. Cheeks and forehead count for the whole face only.
_PARTS = {
    "eyes": (
        33, 7, 163, 144, 145, 153, 154, 155, 133, 246, 161, 160, 159, 158, 157, 173,
        263, 249, 390, 373, 374, 380, 381, 382, 362, 466, 388, 387, 386, 385, 384, 398,
    ),
    "brows": (46, 53, 52, 65, 55, 70, 63, 105, 66, 107, 276, 283, 282, 295, 285, 300, 293, 334, 296, 336),
    "nose": (
        168, 6, 197, 195, 5, 4, 45, 220, 115, 48, 275, 440, 344, 278, 1, 19, 94, 2, 98, 97, 326, 327, 64, 294,
    ),
    "mouth": (
        61, 146, 91, 181, 84, 17, 314, 405, 321, 375, 291, 185, 40, 39, 37, 0, 267, 269, 270, 409,
        78, 95, 88, 178, 87, 14, 317, 402, 318, 324, 308, 191, 80, 81, 82, 13, 312, 311, 310, 415,
    ),
    "jaw and oval": (
        10, 338, 297, 332, 284, 251, 389, 356, 454, 323, 361, 288, 397, 365, 379, 378, 400, 377, 152, 148,
        176, 149, 150, 136, 172, 58, 132, 93, 234, 127, 162, 21, 54, 103, 67, 109,
    ),
}  # fmt: skip

FACE_MESH = Topology(
    name="mediapipe-face-mesh-468",
    count=468,
    right_eye_outer=33,
    left_eye_outer=263,
    chin=152,
    nose_tip=1,
    parts=_PARTS,
    ibug_68=_IBUG_68,
    # The mediapipe wheel does not carry the geometry of its canonical face, so we measure our own
    # on 24 parametric heads: scripts/make_reference_face.py rebuilds both files.
    reference_csv="reference_face.csv",
    surface_csv="surface_face.csv",
    # MediaPipe's canonical face fitted to reference_face.csv; scripts/make_reference_face.py prints it.
    level_pitch_deg=-4.784,
    packaged_anchors=("parametric_anchors.csv",),
)
"""MediaPipe Face Mesh, without the points of the irises."""
