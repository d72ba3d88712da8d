# SPDX-License-Identifier: MIT
"""Where else a picture is looked at for faces: far ones, tiles, turned; a detector sees what it is told."""

from __future__ import annotations

import numpy as np
import pytest

from downstream_hpe.errors import DataError
from downstream_hpe.prediction import crowd
from downstream_hpe.prediction.crowd import OVERLAP, SMALLEST, is_new, tiles
from downstream_hpe.prediction.detector import FaceDetector
from downstream_hpe.prediction.plausibility import DOUBTED, STEEP, FaceShapes, quarter_turns

# ---- tiles --------------------------------------------------------------


def test_tiles_cover_a_picture_and_a_face_is_one():
    covered = np.zeros((700, 1000), dtype=int)
    for left, top, side in tiles(1000, 700):
        assert side <= 500 and left >= 0 and top >= 0
        covered[top : top + side, left : left + side] += 1
    assert covered.min() >= 2  # by two sizes of tiles
    assert not list(tiles(200, 200))
    at = np.array([100.0, 100.0])
    assert not is_new((at + 10, 40.0), [(at, 50.0)]) and is_new((at + 30, 40.0), [(at, 50.0)])


@pytest.mark.parametrize(("width", "height"), [(1000, 700), (700, 1000), (4000, 900), (640, 640)])
def test_tiles_halve_and_overlap_as_they_say(width, height):
    sides: dict[int, list[tuple[int, int]]] = {}
    for left, top, side in tiles(width, height):
        sides.setdefault(side, []).append((left, top))
    longer = max(width, height)
    halved = [longer >> n for n in range(1, crowd.HALVINGS + 1)]
    assert list(sides) == [side for side in halved if side >= SMALLEST]
    for side, corners in sides.items():
        for axis, length in enumerate((width, height)):
            starts = sorted({corner[axis] for corner in corners})
            assert starts[0] == 0 and (starts[-1] == length - side or length <= side)
            steps = np.diff(starts)
            # A face of the overlap's size is whole in one of them, and no more are looked at than that takes.
            assert (steps <= (1 - OVERLAP) * side + 1).all()
            fewest = 1 if length <= side else 1 + int(np.ceil((length - side) / ((1 - OVERLAP) * side)))
            assert len(starts) == fewest


def test_the_smallest_tile_is_still_one():
    assert {side for _, _, side in tiles(2 * SMALLEST, 100)} == {SMALLEST}
    assert not list(tiles(2 * SMALLEST - 1, 100))


# ---- a detector that sees what it is told -------------------------------

BACKGROUND = 7
"""Of a picture; where a face is, the pixel at its middle says which."""


class Seeing(FaceDetector):
    """Its mesh sees the faces whose mark lies in what it is shown and that are at least share of its side.

    faces: by mark, size in pixels. far: what the detector of far faces says.
    """

    def __init__(self, faces: dict[int, float], share: float = 1 / 9, far=()):
        super().__init__()
        self.sizes, self.share, self.far = faces, share, list(far)
        self.asked: list[int] = []

    def mesh(self, rgb, limit=1):
        self.asked.append(limit)
        found = []
        for mark, size in self.sizes.items():
            at = np.argwhere(rgb[..., 0] == mark)
            if len(at) and size >= self.share * max(rgb.shape):
                found.append(face_at(at[0][::-1] + 0.5, size))
        return found[:limit]

    def _far_faces(self, rgb):
        return self.far


def face_at(middle, size):
    """A plausible, upright face around a pixel."""
    points = FaceShapes.load().mean
    turn = -int(quarter_turns(points[None])[0]) % 4
    for _ in range(turn):
        points = points @ np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
    scaled = (points - [*(low + high) / 2, 0]) * size / (high - low).max()
    return scaled + np.array([*middle, 0])


def picture(marks: dict[int, tuple[int, int]], width=1600, height=1000):
    """BGR; marks: pixel of each, x and y."""
    bgr = np.full((height, width, 3), BACKGROUND, np.uint8)
    for mark, (x, y) in marks.items():
        bgr[y, x] = mark
    return bgr


def middles(faces):
    return sorted(
        ((face[:, :2].min(0) + face[:, :2].max(0)) / 2).round().astype(int).tolist() for face in faces
    )


CROWD = {100: (200, 300), 101: (800, 500), 102: (1400, 800)}


def test_faces_too_small_for_the_picture_are_found_in_its_tiles():
    looks = Seeing(dict.fromkeys(CROWD, 100.0))
    found = looks.faces(picture(CROWD), limit=9)
    assert np.abs(np.array(middles(found)) - sorted(CROWD.values())).max() <= 1
    assert len(looks.faces(picture(CROWD), limit=2)) == 2
    # One face alone, and looks that may take no time, do without tiles.
    assert not len(looks.faces(picture(CROWD), limit=1))
    assert not len(looks.faces(picture(CROWD), limit=9, turned=False))


def test_a_face_that_was_found_is_not_found_again_in_tiles():
    marks = {100: (800, 500), 101: (300, 300)}
    looks = Seeing({100: 300.0, 101: 90.0})
    found = looks.faces(picture(marks), limit=9)
    assert np.abs(np.array(middles(found)) - [[300, 300], [800, 500]]).max() <= 1


def test_a_far_face_is_cut_out_where_the_other_detector_says():
    marks = {100: (1000, 400)}
    looks = Seeing({100: 60.0}, far=[(np.array([1002.0, 398.0]), 64.0)])
    [face] = looks.faces(picture(marks), turned=False)
    assert np.abs(np.array(middles([face])[0]) - marks[100]).max() <= 1
    # Not where a face is already, nor when there are enough, nor where nobody is.
    looks = Seeing({100: 400.0}, far=[(np.array([1010.0, 410.0]), 64.0), (np.array([100.0, 100.0]), 64.0)])
    assert len(looks.faces(picture(marks), limit=5, turned=False)) == 1
    before = len(looks.asked)
    assert len(looks.faces(picture(marks), limit=1, turned=False)) == 1
    assert looks.asked[before:] == [1, 1] or looks.asked[before:] == [1]


class Turned(FaceDetector):
    """Sees a face only in a picture whose mark has come to one of its four corners."""

    def __init__(self, corner: int):
        super().__init__()
        self.corner = corner

    def mesh(self, rgb, limit=1):
        corners = [rgb[0, 0, 0], rgb[0, -1, 0], rgb[-1, -1, 0], rgb[-1, 0, 0]]
        middle = np.array([rgb.shape[1] / 2, rgb.shape[0] / 2])
        return [face_at(middle, 40.0)] if corners[self.corner] == 200 else []

    def _far_faces(self, rgb):
        return []


@pytest.mark.parametrize("corner", [0, 1, 2, 3])
def test_a_head_on_any_side_is_found_by_turning_the_picture(corner):
    bgr = np.full((100, 100, 3), BACKGROUND, np.uint8)
    bgr[0, 0] = 200
    [face] = Turned(corner).faces(bgr)
    assert np.abs(np.array(middles([face])[0]) - 50).max() <= 1
    upright = face_at(np.array([50.0, 50.0]), 40.0)
    quarters = int(quarter_turns(face[None])[0] - quarter_turns(upright[None])[0]) % 4
    assert quarters == -corner % 4, "as it is in the picture, not as it was seen"
    assert len(Turned(corner).faces(bgr, turned=False)) == (corner == 0)


def test_how_a_plausibility_halves_a_confidence():
    shapes = FaceShapes.load()
    face = shapes.mean[None] * np.array([0.87, 1, 1])
    p = float(shapes.plausibility(face)[0])
    assert (DOUBTED, STEEP) == (0.2, 3), "the shipped model was measured with these"
    assert float(shapes.share(face)[0]) == pytest.approx(p**3 / (p**3 + 0.2**3))


@pytest.mark.parametrize(
    ("roll", "quarters"), [(55.0, 0), (59.5, 0), (-59.5, 0), (60.5, 1), (134.0, 1), (136.0, 2), (-60.5, 3)]
)
def test_a_face_is_upright_up_to_sixty_degrees(roll, quarters):
    from downstream_hpe.geometry.mean_head import mean_head
    from downstream_hpe.geometry.rotation import fit_rotation, rotation_from_angles

    face = face_at(np.zeros(2), 1.0)
    level = face @ fit_rotation(mean_head(), face[None])[0]
    rolled = (level @ rotation_from_angles(np.array([0.0, 0, roll])).T)[None]
    assert int(quarter_turns(rolled)[0]) == quarters


@pytest.mark.parametrize(("share", "looks"), [(1 / 3, 1), (1 / 2, 2), (1 / 5, 1), (0.99, None)])
def test_a_box_of_others_is_looked_into_in_three_sizes(share, looks):
    """In squares of 2.5, 1.7 and 4 times its side, by a mesh that sees faces of so large a share."""
    marks = {100: (800, 500)}
    seeing = Seeing({100: 100.0}, share=share)
    face = seeing.at(picture(marks)[..., ::-1], (np.array([800.0, 500.0]), 100.0))
    assert (face is not None) == (looks is not None) and len(seeing.asked) == (looks or 3)
    if face is not None:
        assert np.abs(np.array(middles([face])[0]) - marks[100]).max() <= 1


def test_a_box_is_looked_into_in_the_colours_of_the_mesh():
    blue = np.zeros((900, 900, 3), np.uint8)
    blue[450, 450] = (0, 0, 100)
    assert Seeing({100: 100.0}).at(blue, (np.array([450.0, 450.0]), 100.0)) is not None
    assert Seeing({100: 100.0}).at(blue[..., ::-1], (np.array([450.0, 450.0]), 100.0)) is None


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros((9, 9), np.uint8),
        np.zeros((9, 9, 4), np.uint8),
        np.zeros((9, 9, 3)),
        np.zeros((0, 9, 3), np.uint8),
    ],
)
def test_other_arrays_are_refused(wrong):
    with pytest.raises(DataError, match="expected a uint8 picture"):
        Seeing({}).faces(wrong)
