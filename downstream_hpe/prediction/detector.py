# SPDX-License-Identifier: MIT
"""Faces in a picture: Face Mesh, and for faces too small for it a closer look."""

from __future__ import annotations

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.geometry.face_mesh import POINTS
from downstream_hpe.geometry.metrics import geodesic_errors
from downstream_hpe.geometry.rotation import fit_rotation
from downstream_hpe.prediction.landmarkers import Place, open_landmarker
from downstream_hpe.prediction.plausibility import FaceShapes

CLOSER = 2.5
"""Side of the square for a closer look, in sizes of the face."""
DOUBTFUL = 0.8
"""Faces less plausible than this are looked at again, turned."""
ALIKE_DEG = 45.0
LARGE_ENOUGH = 0.3
"""Faces of this share of the picture's longer side gain nothing from it: benchmarks/small_faces.py."""


class FaceDetector:
    """Opens its models when they are first needed. ModelError: they are not installed.

    landmarker: see :func:`downstream_hpe.prediction.landmarkers.open_landmarker`.
    """

    def __init__(self, landmarker: str | None = None) -> None:
        self._landmarker = open_landmarker(landmarker)

    def faces(self, bgr: np.ndarray, limit: int = 1, turned: bool = True) -> np.ndarray:
        """Landmarks of the most prominent faces: float64 [F, 468, 3], 0 <= F <= limit, isotropic pixels,
        frame C.

        Face Mesh finds faces from about a ninth of the picture's longer side on, and places them badly
        where they are small: a face is looked at again in a square cut out around it. Where it finds
        fewer than limit, MediaPipe's full-range face detector, which sees faces half that size, says
        where to cut. bgr: uint8 [H, W, 3]; DataError: another array.

        turned: a doubtful face is looked at in the other quarter turns of the square around it, too, for Face
        Mesh answers with an upright face on many an upside-down head; and a picture without a face is turned.
        """
        if bgr.ndim != 3 or bgr.shape[2] != 3 or bgr.dtype != np.uint8 or not bgr.size:
            raise DataError(f"expected a uint8 picture [H, W, 3], got {bgr.dtype} {bgr.shape}")
        rgb = np.ascontiguousarray(bgr[..., ::-1])
        found: list[np.ndarray] = []
        for face in self.mesh(rgb, limit):
            centre, size = _place(face)
            small = size < LARGE_ENOUGH * max(rgb.shape)
            closer = self._closer(rgb, centre, size) if small else None
            found.append(face if closer is None else closer)
        for centre, size in self._far_faces(rgb) if len(found) < limit else []:
            if len(found) < limit and not any(_around(face, centre) for face in found):
                closer = self._closer(rgb, centre, size)
                found += [] if closer is None else [closer]
        if turned:
            looks = [self._looked_at_again(rgb, face) for face in found] or [self._on_its_side(rgb)]
            found = [face for face in looks if face is not None]
        return np.array(found).reshape(-1, POINTS, 3)

    def _on_its_side(self, rgb: np.ndarray) -> np.ndarray | None:
        """A plausible face of a picture that shows none as it is."""
        turned = (self._turned(rgb, quarter) for quarter in (2, 1, 3))
        return next((face for face in turned if face is not None and _plausible(face) > DOUBTFUL), None)

    def _looked_at_again(self, rgb: np.ndarray, face: np.ndarray) -> np.ndarray | None:
        """The face, unless it is doubtful and the three quarter turns of the square around it show another
        one, all the same: then that, or None where it is not plausible either."""
        if _plausible(face) > DOUBTFUL:
            return face
        centre, size = _place(face)
        corner, square = _square(rgb, centre, size)
        others: list[np.ndarray] = []
        for quarter in (1, 3, 2):
            other = self._turned(square, quarter)
            if other is None or _alike(face, other) or not all(_alike(one, other) for one in others):
                return face
            others.append(other + np.array([*corner, 0]))
        said = [_plausible(other) for other in others]
        return others[int(np.argmax(said))] if np.mean(said) > DOUBTFUL else None

    def _turned(self, rgb: np.ndarray, quarter: int) -> np.ndarray | None:
        """The face of a picture turned by so many quarters, in the pixels of the picture as it is."""
        found = self.mesh(np.ascontiguousarray(np.rot90(rgb, quarter)))
        return turned_back(found[0], rgb, quarter) if found else None

    def mesh(self, rgb: np.ndarray, limit: int = 1) -> list[np.ndarray]:
        """The landmarker alone: the faces of a contiguous RGB picture, each float64 [468, 3]."""
        return self._landmarker.mesh(rgb, limit)

    def _far_faces(self, rgb: np.ndarray) -> list[Place]:
        """Where a detector that sees smaller faces finds some."""
        return self._landmarker.far(rgb)

    def close(self) -> None:
        """Free the models."""
        self._landmarker.close()

    def _closer(self, rgb: np.ndarray, centre: np.ndarray, size: float) -> np.ndarray | None:
        """The face at centre, pixels, from a square around it; None where none is found there."""
        corner, square = _square(rgb, centre, size)
        if not square.size:
            return None
        seen = (face + np.array([*corner, 0]) for face in self.mesh(square, 1))
        return next((face for face in seen if _around(face, centre)), None)


def turned_back(points: np.ndarray, picture: np.ndarray, quarter: int) -> np.ndarray:
    """Landmarks [..., 3] found in np.rot90(picture, quarter), in the pixels of the picture as it is."""
    x, y, z = np.moveaxis(points, -1, 0)
    for turn in reversed(range(quarter)):
        # np.rot90 takes column x of a picture of some width to row width - x.
        x, y = picture.shape[1 - turn % 2] - y, x
    return np.stack([x, y, z], axis=-1)


def _place(face: np.ndarray) -> Place:
    """Centre [2] and longer side of the box of a face's landmarks."""
    low, high = face[:, :2].min(axis=0), face[:, :2].max(axis=0)
    return (low + high) / 2, float((high - low).max())


def _square(rgb: np.ndarray, centre: np.ndarray, size: float) -> tuple[tuple[int, int], np.ndarray]:
    """Left and top, and what of the picture lies in the square for a closer look."""
    left, top = np.maximum(centre - CLOSER / 2 * size, 0).astype(int).tolist()
    right, bottom = np.maximum(centre + CLOSER / 2 * size, 0).astype(int).tolist()
    return (left, top), np.ascontiguousarray(rgb[top:bottom, left:right])


def _plausible(face: np.ndarray) -> float:
    """:meth:`FaceShapes.plausibility` of a single one."""
    return float(FaceShapes.load().plausibility(face[None])[0])


def _alike(face: np.ndarray, other: np.ndarray) -> bool:
    """Whether two looks are of one face, turned the same way."""
    return bool(geodesic_errors(fit_rotation(face, other[None])[0], np.eye(3)) < ALIKE_DEG)


def _around(face: np.ndarray, point: np.ndarray) -> bool:
    """Whether a point lies in the box of a face's landmarks."""
    low, high = face[:, :2].min(axis=0), face[:, :2].max(axis=0)
    return bool(((point >= low) & (point <= high)).all())
