# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors of a topology of meshes: fixed once, good for every mesh with the same triangles."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from generator.geometry.rotation import geodesic_deg, graphics_rotation
from generator.landmarks.anchors import Anchors
from generator.landmarks.facing import facing, levelling_problem
from generator.landmarks.topology import Topology

_HEADER = (
    "mesh", "count", "heads", "views", "off", "residual_px", "residual_mm", "correction", "correction_sd_deg",
)  # fmt: skip


MISALIGNED_DEG = 12.0
"""A head whose face is turned by more than this from the others of its topology was not aligned with them.
Less is how faces differ: 3 degrees of pitch, a standard deviation."""


def mesh_key(triangles: np.ndarray) -> str:
    """What meshes of one topology share: the SHA-256 of their triangles, int [T, 3]."""
    return hashlib.sha256(np.ascontiguousarray(triangles, dtype="<i4").tobytes()).hexdigest()


@dataclass(frozen=True, eq=False)
class SharedAnchors:
    """Where the landmarks lie on all meshes of a topology, and where their pose zero is.

    mesh, count: key and number of the triangles. A mesh may have more behind them, such as long hair.
    anchors: on the mean of the heads they were found on, triangles as in the mesh's file; their
        points are that mean's, frame C in the source's axes, mm, about the pivot.
    heads: how many those were.
    correction: R_U, row-major, from the source's axes to pose zero "level"; correction_sd_deg: how
        sure it is, about the axes of yaw, pitch and roll.
    """

    mesh: str
    count: int
    anchors: Anchors
    heads: int
    correction: tuple[float, ...]
    correction_sd_deg: tuple[float, ...]

    def fits(self, triangles: np.ndarray) -> bool:
        """Is it about meshes with these triangles? int [T, 3]."""
        return len(triangles) >= self.count and mesh_key(triangles[: self.count]) == self.mesh

    def points(self, vertices: np.ndarray, triangles: np.ndarray) -> np.ndarray:
        """The landmarks on a mesh of the topology, float64 [P, 3]; NaN where there is no anchor.

        vertices: float [V, 3]. triangles: int [T, 3].
        """
        corners = vertices[triangles[self.anchors.triangles]]
        return (self.anchors.weights[:, :, None] * corners).sum(1)

    def contradiction(self, topology: Topology) -> str:
        """What cannot be so whatever the mesh, or ""."""
        if problem := self.anchors.contradiction(topology):
            return problem
        if len(self.correction) != 9 or len(self.correction_sd_deg) != 3:
            return "its correction is no rotation"
        matrix = np.reshape(self.correction, (3, 3))
        if not (np.abs(matrix @ matrix.T - np.eye(3)) <= 1e-7).all() or np.linalg.det(matrix) < 0:
            return "its correction is no rotation"
        there = self.anchors.triangles
        return "an anchor's triangle does not exist" if (there >= self.count).any() else ""

    def correction_of(self, points: np.ndarray, topology: Topology) -> np.ndarray:
        """R_U [3, 3] to pose zero "level" of a head: all heads' of the topology, unless it was not aligned.

        points: its anchors, float [P, 3], frame C in the source's axes.
        """
        correction = np.reshape(self.correction, (3, 3))
        own, usual = facing(points, topology), facing(self.anchors.points, topology)
        if own is None or usual is None or geodesic_deg(own, usual) <= MISALIGNED_DEG:
            return correction
        return correction @ graphics_rotation(usual @ own.T)


def packaged(topology: Topology) -> tuple[SharedAnchors, ...]:
    """Those that come with the package, one for each kind of mesh that it makes itself."""
    return tuple(map(_read_packaged, topology.packaged_anchors))


def shared_levelling_problem(
    frame: str,
    correction: Sequence[float],
    sd_deg: Sequence[float],
    heads: Sequence[np.ndarray],
    topology: Topology,
    way: str,
) -> str:
    """:func:`generator.landmarks.facing.levelling_problem` of heads whose anchors were found this way."""
    known = packaged(topology) if way == "package" else ()

    def correct(shared: SharedAnchors) -> Callable[[np.ndarray], np.ndarray]:
        return lambda points: shared.correction_of(points, topology)

    return levelling_problem(frame, correction, sd_deg, heads, topology, map(correct, known))


@cache
def _read_packaged(name: str) -> SharedAnchors:
    return parse_shared(files("generator.landmarks").joinpath(name).read_text(encoding="ascii"))


def write_shared(shared: SharedAnchors, path: Path, made_by: str) -> None:
    """Write a table of text: what is said once in its header, a line a point below."""
    a = shared.anchors
    said = {
        "mesh": shared.mesh,
        "count": shared.count,
        "heads": shared.heads,
        "views": a.views,
        "off": a.off,
        "residual_px": round(a.residual_px, 3),
        "residual_mm": round(a.residual_mm, 3),
        "correction": " ".join(f"{value:.9f}" for value in shared.correction),
        "correction_sd_deg": " ".join(f"{value:.3f}" for value in shared.correction_sd_deg),
    }
    head = [f"# made by {made_by}", *(f"# {key}: {said[key]}" for key in _HEADER)]
    rows = [
        f"{triangle},{','.join(f'{w:.6f}' for w in weights)},{','.join(f'{x:.4f}' for x in point)}"
        for triangle, weights, point in zip(a.triangles.tolist(), a.weights, a.points, strict=True)
    ]
    columns = "# triangle,weight,weight,weight,x mm,y mm,z mm"
    path.write_text("\n".join([*head, columns, *rows]) + "\n", encoding="ascii", newline="\n")


def parse_shared(text: str) -> SharedAnchors:
    """The inverse of :func:`write_shared`."""
    lines = [line[2:] for line in text.splitlines() if line.startswith("# ")]
    said = dict(line.split(": ", 1) for line in lines if ": " in line)
    table = np.loadtxt(text.splitlines(), delimiter=",", comments="#")
    anchors = Anchors(
        triangles=table[:, 0].astype(np.int32),
        weights=table[:, 1:4],
        points=table[:, 4:7],
        views=int(said["views"]),
        off=int(said["off"]),
        residual_px=float(said["residual_px"]),
        residual_mm=float(said["residual_mm"]),
        way="package",
    )
    correction, sd = (tuple(map(float, said[name].split())) for name in ("correction", "correction_sd_deg"))
    return SharedAnchors(said["mesh"], int(said["count"]), anchors, int(said["heads"]), correction, sd)


def of_subject(triangles: np.ndarray, anchors: Anchors) -> SharedAnchors:
    """A head's own anchors, for the other expressions of its subject. triangles: of its mesh, as read.

    Where pose zero is, its subject's placement knows already.
    """
    own = replace(anchors, way="subject")
    nothing = (float("nan"),)
    return SharedAnchors(mesh_key(triangles), len(triangles), own, 1, nothing * 9, nothing * 3)
