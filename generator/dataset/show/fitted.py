# SPDX-License-Identifier: GPL-3.0-or-later
"""An image of any shape in a square tile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from PIL import Image


@dataclass(frozen=True)
class Fitted:
    """Where an image lies in a tile of this side: as large as it goes, in the middle.

    longest: the longer side of the image, pixels of its own. left, top, width, height: in the tile.
    """

    side: int
    longest: int
    left: int
    top: int
    width: int
    height: int

    @classmethod
    def of(cls, width: int, height: int, side: int) -> Fitted:
        """The place of an image of width x height pixels."""
        longest = max(width, height, 1)
        wide, high = (max(1, round(size * side / longest)) for size in (width, height))
        return cls(side, longest, (side - wide) // 2, (side - high) // 2, wide, high)

    def points(self, pixels: np.ndarray) -> np.ndarray:
        """Places in the image as places in the tile. float [N, >= 2] -> float64 [N, 2]."""
        return pixels[:, :2] * self.side / self.longest + (self.left, self.top)

    def paste(self, picture: Image.Image, paper: str) -> Image.Image:
        """The picture in its place on a tile of paper."""
        shown = picture.resize((self.width, self.height), Image.Resampling.LANCZOS)
        if shown.size == (self.side, self.side):
            return shown
        tile = Image.new("RGB", (self.side, self.side), paper)
        tile.paste(shown, (self.left, self.top))
        return tile
