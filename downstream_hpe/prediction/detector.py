# SPDX-License-Identifier: MIT
"""Faces in a picture: Face Mesh, and for faces too small for it a closer look."""

from __future__ import annotations

from functools import partial

import numpy as np

from downstream_hpe.errors import DataError
from downstream_hpe.geometry.face_mesh import POINTS
from downstream_hpe.geometry.metrics import geodesic_errors
from downstream_hpe.geometry.rotation import fit_rotation
from downstream_hpe.prediction.crowd import Tile, is_new, tiles
from downstream_hpe.prediction.given import without_copy
from downstream_hpe.prediction.landmarker_pool import LandmarkerPool
from downstream_hpe.prediction.landmarkers import Place, landmarker_name, open_landmarker
from downstream_hpe.prediction.plausibility import FaceShapes
from litert_faces.blendshapes import NAMES as BLENDSHAPES

CLOSER = 2.5
"""Side of the square for a closer look, in sizes of the face."""
CLOSER_TO_BOXES = (2.5, 1.7, 4.0)
"""The same for boxes of others, one after the other."""
IN_A_TILE = 8
"""Faces, at most; where there are more, the next smaller tiles show them."""
DOUBTFUL = 0.8
"""Faces less plausible than this are looked at again, turned."""
ALIKE_DEG = 45.0
LARGE_ENOUGH = 0.3
"""Faces of this share of the picture's longer side gain nothing from it: benchmarks/small_faces.py."""


class FaceDetector:
    """Opens its models when they are first needed. ModelError: they are not installed. Threads may share one.

    landmarker, and name: see :func:`downstream_hpe.prediction.landmarkers.landmarker_name`.
    """

    def __init__(self, landmarker: str | None = None) -> None:
        self.name = landmarker_name(landmarker)
        self._landmarkers = LandmarkerPool(partial(open_landmarker, self.name))

    def faces(self, bgr: np.ndarray, limit: int = 1, turned: bool = True) -> np.ndarray:
        """Landmarks of the most prominent faces: float64 [F, 468, 3], 0 <= F <= limit, isotropic pixels,
        frame C.

        Face Mesh finds faces from about a ninth of the picture's longer side on, and places them badly
        where they are small: a face is looked at again in a square cut out around it. Where it finds
        fewer than limit, MediaPipe's full-range face detector, which sees faces half that size, says
        where to cut. bgr: uint8 [H, W, 3]; DataError: another array.

        turned: there is time for more looks. Tiles of the picture are looked at, where it shows fewer than a
        limit of several; a doubtful face is looked at in the other quarter turns of the square around it,
        too, for Face Mesh answers with an upright face on many an upside-down head; and a picture without a
        face is turned.
        """
        if bgr.ndim != 3 or bgr.shape[2] != 3 or bgr.dtype != np.uint8 or not bgr.size:
            raise DataError(f"expected a uint8 picture [H, W, 3], got {bgr.dtype} {bgr.shape}")
        rgb = without_copy(bgr)
        found: list[np.ndarray] = []
        for face in self.mesh(rgb, limit):
            centre, size = place_of(face)
            small = size < LARGE_ENOUGH * max(rgb.shape)
            closer = self._closer(rgb, centre, size) if small else None
            found.append(face if closer is None else closer)
        for centre, size in self._far_faces(rgb) if len(found) < limit else []:
            if len(found) < limit and not any(_around(face, centre) for face in found):
                closer = self._closer(rgb, centre, size)
                found += [] if closer is None else [closer]
        if turned and limit > 1 and len(found) < limit:
            found += self._in_tiles(rgb, found, limit - len(found))
        if turned:
            looks = [self._looked_at_again(rgb, face) for face in found] or [self._on_its_side(rgb)]
            found = [face for face in looks if face is not None]
        return np.array(found).reshape(-1, POINTS, 3)

    def _in_tiles(self, rgb: np.ndarray, before: list[np.ndarray], limit: int) -> list[np.ndarray]:
        """Faces of a group photograph that are none of those before, at most so many more."""
        found: list[np.ndarray] = []
        for tile in tiles(rgb.shape[1], rgb.shape[0]):
            found += self._in_tile(rgb, tile, [*before, *found])
            if len(found) >= limit:
                break
        return found[:limit]

    def _in_tile(self, rgb: np.ndarray, tile: Tile, before: list[np.ndarray]) -> list[np.ndarray]:
        """A face that a tile shows counts if a closer look at it in the picture shows it, too."""
        found: list[np.ndarray] = []
        places = [place_of(face) for face in before]
        left, top, side = tile
        square = np.ascontiguousarray(rgb[top : top + side, left : left + side])
        for centre, size in map(place_of, self.mesh(square, IN_A_TILE)):
            centre = centre + np.array([left, top])
            face = self._closer(rgb, centre, size) if is_new((centre, size), places) else None
            if face is not None and is_new(place_of(face), places):
                found.append(face)
                places.append(place_of(face))
        return found

    def in_tile(self, bgr: np.ndarray, tile: Tile, before: list[np.ndarray]) -> list[np.ndarray]:
        """Landmarks [468, 3] of each face that a tile of a picture shows and that is none of those before."""
        return self._in_tile(without_copy(bgr), tile, before)

    def at(self, bgr: np.ndarray, place: Place) -> np.ndarray | None:
        """Landmarks [468, 3] of the face at a place that was found otherwise; None where Face Mesh sees none
        there. Others' boxes are larger or smaller, so the square around it is, too. bgr: as :meth:`faces`."""
        rgb = np.ascontiguousarray(bgr[..., ::-1])
        looks = (self._closer(rgb, *place, closer) for closer in CLOSER_TO_BOXES)
        return next((face for face in looks if face is not None), None)

    def blendshapes(self, rgb: np.ndarray, faces: np.ndarray) -> np.ndarray:
        """What faces do that :meth:`faces` found: float32 [F, 52], NaN where one is not seen again.

        rgb: uint8 [H, W, 3], contiguous. ModelError: the landmarker is no face_landmarker.task.
        """
        with self._landmarkers.one() as landmarker:
            found = [landmarker.blendshapes(rgb, face) for face in faces]
        unseen = np.full(len(BLENDSHAPES), np.nan, dtype=np.float32)
        return np.array([unseen if one is None else one for one in found]).reshape(-1, len(BLENDSHAPES))

    def _on_its_side(self, rgb: np.ndarray) -> np.ndarray | None:
        """A plausible face of a picture that shows none as it is."""
        turned = (self._turned(rgb, quarter) for quarter in (2, 1, 3))
        return next((face for face in turned if face is not None and _plausible(face) > DOUBTFUL), None)

    def _looked_at_again(self, rgb: np.ndarray, face: np.ndarray) -> np.ndarray | None:
        """The face, unless it is doubtful and the three quarter turns of the square around it show another
        one, all the same: then that, or None where it is not plausible either."""
        if _plausible(face) > DOUBTFUL:
            return face
        centre, size = place_of(face)
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
        found = self.mesh(_turned(rgb, quarter))
        return turned_back(found[0], rgb, quarter) if found else None

    def mesh(self, rgb: np.ndarray, limit: int = 1) -> list[np.ndarray]:
        """The landmarker alone: the faces of a contiguous RGB picture, each float64 [468, 3]."""
        with self._landmarkers.one() as landmarker:
            return landmarker.mesh(rgb, limit)

    def _far_faces(self, rgb: np.ndarray) -> list[Place]:
        """Where a detector that sees smaller faces finds some."""
        with self._landmarkers.one() as landmarker:
            return landmarker.far(rgb)

    def close(self) -> None:
        """Free the models; another look opens them anew."""
        self._landmarkers.close()

    def _closer(
        self, rgb: np.ndarray, centre: np.ndarray, size: float, closer: float = CLOSER
    ) -> np.ndarray | None:
        """The face at centre, pixels, from a square around it; None where none is found there."""
        corner, square = _square(rgb, centre, size, closer)
        if not square.size:
            return None
        seen = (face + np.array([*corner, 0]) for face in self.mesh(square, 1))
        return next((face for face in seen if _around(face, centre)), None)


def _turned(rgb: np.ndarray, quarter: int) -> np.ndarray:
    """np.rot90 of a contiguous picture, contiguous."""
    # A pixel at a time: a third of the time of one number at a time.
    pixels = np.ascontiguousarray(np.rot90(rgb.view("V3")[..., 0], quarter))
    return pixels.view(np.uint8).reshape(*pixels.shape, 3)


def turned_back(points: np.ndarray, picture: np.ndarray, quarter: int) -> np.ndarray:
    """Landmarks [..., 3] found in np.rot90(picture, quarter), in the pixels of the picture as it is."""
    x, y, z = np.moveaxis(points, -1, 0)
    for turn in reversed(range(quarter)):
        # np.rot90 takes column x of a picture of some width to row width - x.
        x, y = picture.shape[1 - turn % 2] - y, x
    return np.stack([x, y, z], axis=-1)


def place_of(face: np.ndarray) -> Place:
    """Centre [2] and longer side of the box of a face's landmarks."""
    low, high = face[:, :2].min(axis=0), face[:, :2].max(axis=0)
    return (low + high) / 2, float((high - low).max())


def _square(
    rgb: np.ndarray, centre: np.ndarray, size: float, closer: float = CLOSER
) -> tuple[tuple[int, int], np.ndarray]:
    """Left and top, and what of the picture lies in the square for a closer look."""
    left, top = np.maximum(centre - closer / 2 * size, 0).astype(int).tolist()
    right, bottom = np.maximum(centre + closer / 2 * size, 0).astype(int).tolist()
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
