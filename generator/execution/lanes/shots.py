# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures as a camera gives them: what a render worker left, before its backdrop, developed."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from generator.errors import WorkerError
from generator.execution.lanes.renderer import Renderer
from generator.messages import Rendered
from generator.picture.develop import developed, softened
from generator.picture.scenery import Folders, Scenery
from generator.placing.rendering import read_image
from generator.plan.render_settings import is_denoised
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
    ) -> Iterator[Rendered]:
        """What is left of each view, for :meth:`finish`. Raises HeadError, also for an environment that is
        not there; otherwise as :meth:`Renderer.shoot`."""
        if folders != self._folders:
            self._folders, self._scenery = folders, Scenery(folders)
        return self._renderer.shoot(package, views, self._scenery.lights(views), worn)

    def finish(self, rendered: Rendered, view: View) -> np.ndarray:
        """The picture that it becomes, uint8 [H, W, 3], RGB; the file is removed.

        Raises WorkerError if it is none, or of another size, HeadError if a backdrop cannot be read.
        """
        path = Path(rendered.path)
        if path.suffix == ".exr":
            left, right, bottom, top = rendered.box or (0, view.camera.width, 0, view.camera.height)
            head = _read_head(path, (top - bottom, right - left))
            if is_denoised(view.look):
                head[..., 3] = softened(head[..., 3])
            image = self._scenery.composed(head, (left, view.camera.height - top), view)
        else:
            image = read_image(path)
        if image.shape != (view.camera.height, view.camera.width, 3):
            raise WorkerError(f"{path}: the render worker left an image of another size")
        return developed(image, view.look, view.seed)

    def take(
        self, package: Path, views: Views, folders: Folders, worn: tuple[tuple[Worn, ...], ...] = ()
    ) -> Iterator[np.ndarray]:
        """The pictures of some views, one after another."""
        for view, rendered in zip(views, self.start(package, views, folders, worn), strict=True):
            yield self.finish(rendered, view)


def _read_head(path: Path, size: tuple[int, int]) -> np.ndarray:
    """A head over nothing, float [*size, 4], linear, multiplied by alpha; the file is removed."""
    import OpenEXR

    try:
        with OpenEXR.File(str(path)) as file:
            head = np.array(file.channels()["RGBA"].pixels)
    except (OSError, RuntimeError, KeyError, TypeError, ValueError) as error:
        raise WorkerError(f"{path}: the render worker left no readable image") from error
    finally:
        path.unlink(missing_ok=True)
    if head.shape != (*size, 4):
        raise WorkerError(f"{path}: the render worker left an image of another size")
    return head
