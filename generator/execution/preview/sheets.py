# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of the preview server as files, and several of them in one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np


def write_images(
    images: list[np.ndarray], folder: Path, tiles: list[np.ndarray], columns: int
) -> dict[str, Any]:
    """Images as files, and with columns the tiles in one picture: what an answer says of them."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{index:03d}.png" for index in range(len(images))]
    for image, path in zip(images, paths, strict=True):
        write_image(image, path)
    answer: dict[str, Any] = {"pictures": [str(path) for path in paths]}
    if columns:
        tiles = [*tiles, *[np.zeros_like(tiles[0])] * (-len(tiles) % columns)]
        rows = [np.hstack(tiles[k : k + columns]) for k in range(0, len(tiles), columns)]
        write_image(np.vstack(rows), folder / "sheet.png")
        answer["sheet"] = str(folder / "sheet.png")
    return answer


def named(image: np.ndarray, name: str) -> np.ndarray:
    """A copy of an image with a name in its lower left corner."""
    marked, size = image.copy(), len(image) / 400
    place = (round(8 * size), len(image) - round(10 * size))
    for colour, width in (((0, 0, 0), 4), ((255, 255, 255), 1.5)):
        thick = max(1, round(width * size * 1.5))
        cv2.putText(marked, name, place, cv2.FONT_HERSHEY_SIMPLEX, size, colour, thick, cv2.LINE_AA)
    return marked


def write_image(image: np.ndarray, path: Path) -> None:
    """An RGB image as a file."""
    cv2.imwrite(str(path), cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
