# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as a camera gives them: what a render worker left, before its backdrop, developed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from generator.errors import WorkerError
from generator.execution.lanes.renderer import Renderer
from generator.picture.develop import developed
from generator.picture.scenery import Folders, Scenery
from generator.placing.rendering import read_image
from generator.plan.views import View, Views
from generator.plan.wear import Worn


class Shots:
    """Takes pictures; panoramas and pictures of the folders that it was told last stay at hand."""

    def __init__(self, renderer: Renderer) -> None:
        self._renderer = renderer
        self._folders = Folders()
        self._scenery = Scenery(self._folders)

    def start(
        self, package: Path, views: Views, folders: Folders, worn: tuple[tuple[Worn, ...], ...] = ()
    ) -> Iterator[Path]:
        """The file of each view, for :meth:`finish`. Raises HeadError, also for an environment that is not
        there; otherwise as :meth:`Renderer.render`."""
        if folders != self._folders:
            self._folders, self._scenery = folders, Scenery(folders)
        return self._renderer.render(package, views, lights=self._scenery.lights(views), worn=worn)

    def finish(self, path: Path, view: View) -> np.ndarray:
        """The picture that a file becomes, uint8 [H, W, 3], RGB; the file is removed.

        Raises WorkerError if it is none, or of another size, HeadError if a backdrop cannot be read.
        """
        if path.suffix == ".exr":
            image = self._scenery.composed(_read_head(path, view), view)
        else:
            image = read_image(path)
        if image.shape != (view.camera.height, view.camera.width, 3):
            raise WorkerError(f"{path}: the render worker left an image of another size")
        return developed(image, view.look, view.seed)

    def take(
        self, package: Path, views: Views, folders: Folders, worn: tuple[tuple[Worn, ...], ...] = ()
    ) -> Iterator[np.ndarray]:
        """The pictures of some views, one after another."""
        for view, path in zip(views, self.start(package, views, folders, worn), strict=True):
            yield self.finish(path, view)


def _read_head(path: Path, view: View) -> np.ndarray:
    """A head over nothing, float16 or float32 [H, W, 4], linear, multiplied by alpha; the file is removed."""
    import OpenEXR

    try:
        with OpenEXR.File(str(path)) as file:
            head = np.array(file.channels()["RGBA"].pixels)
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        raise WorkerError(f"{path}: the render worker left no readable image") from error
    finally:
        path.unlink(missing_ok=True)
    if head.shape != (view.camera.height, view.camera.width, 4):
        raise WorkerError(f"{path}: the render worker left an image of another size")
    return head
