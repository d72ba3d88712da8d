# SPDX-License-Identifier: MIT
"""Where to look for the faces of a group: tiles, halves of the picture's longer side, quarters and so on."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from downstream_hpe.prediction.landmarkers import Place

HALVINGS = 4
"""So often the tiles are made smaller: the smallest have a sixteenth of the picture's longer side."""
SMALLEST = 160
"""Pixels of a tile's side. Face Mesh finds faces from a ninth of it on; smaller ones have too few pixels."""
OVERLAP = 0.3
"""Of a tile, with the next one: faces of that size lie in one of them whole. Larger ones are found in the
tiles before, or in the picture itself."""
SAME = 0.5
"""Centres closer than this, in sizes of the smaller face, are of one: noses of two people who put their heads
together are a face apart."""


Tile = tuple[int, int, int]
"""Left, top and side of a square, pixels."""


def tiles(width: int, height: int) -> Iterator[Tile]:
    """Left, top and side of squares that cover a picture, pixels; the large ones first."""
    for halving in range(1, HALVINGS + 1):
        side = max(width, height) >> halving
        if side < SMALLEST:
            return
        for top in _starts(height, side):
            for left in _starts(width, side):
                yield left, top, side


def _starts(length: int, side: int) -> list[int]:
    if length <= side:
        return [0]
    steps = int(np.ceil((length - side) / ((1 - OVERLAP) * side)))
    starts: list[int] = np.linspace(0, length - side, steps + 1).round().astype(int).tolist()
    return starts


def is_new(place: Place, places: Sequence[Place]) -> bool:
    """Whether at a place there is none of the faces of other places."""
    centre, size = place
    return all(np.hypot(*(centre - other)) >= SAME * min(size, its) for other, its in places)
