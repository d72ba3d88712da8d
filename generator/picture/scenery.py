# SPDX-License-Identifier: GPL-3.0-or-later
"""What surrounds a head: the light of its environment, and what is behind it. Files are read once."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from generator.errors import HeadError, UsageError
from generator.picture import backdrop
from generator.picture.develop import to_linear
from generator.picture.files import (
    PANORAMAS,
    PICTURES,
    named_files,
    packaged_panoramas,
    read_panorama,
    read_picture,
)
from generator.picture.irradiance import LEAST, LUMINANCE, Irradiance, irradiance, terms
from generator.plan.config import BuildConfig
from generator.plan.environment_light import EnvironmentLight
from generator.plan.render_settings import ENVIRONMENT, NOISE, NOTHING, PICTURE, Look
from generator.plan.views import View

KEPT = 8
"""Panoramas, and as many pictures, at hand: 6 MB each."""

WHITE = 1.0

T = TypeVar("T")


@dataclass(frozen=True)
class Folders:
    """Where they are, as absolute paths. "": the panoramas of Blender, no pictures and no things."""

    environments: str = ""
    pictures: str = ""
    things: str = ""


def folders_of(config: BuildConfig) -> Folders:
    """Those of a configuration."""
    given = config.render.environments, config.render.pictures, config.render.things
    return Folders(*(str(config.located(path)) if path else "" for path in given))


class Scenery:
    """The environments and backdrops of some folders."""

    def __init__(self, folders: Folders) -> None:
        self._folders = folders
        self._files: dict[str, Mapping[str, Path]] = {}
        self._irradiance: dict[str, Irradiance] = {}
        self._panoramas: OrderedDict[str, np.ndarray] = OrderedDict()
        self._pictures: OrderedDict[str, np.ndarray] = OrderedDict()

    def lights(self, views: Sequence[View]) -> tuple[EnvironmentLight | None, ...]:
        """The light of each view; none at all where no view has an environment. Raises HeadError: no such
        file, or it cannot be read."""
        found = tuple(self._light(view.look) for view in views)
        return found if any(found) else ()

    def behind(self, view: View) -> np.ndarray:
        """What the camera sees behind the head, linear, float32 [H, W, 3]. Raises as :meth:`lights` does."""
        look, camera = view.look, view.camera
        if look.backdrop == NOISE:
            return backdrop.noise(camera, view.seed)
        if look.backdrop == PICTURE:
            path = self._path("pictures", look.backdrop_picture)
            return backdrop.filling(_kept(self._pictures, path, read_picture), camera)
        light = self._light(look)
        if look.backdrop == ENVIRONMENT and light is not None:
            panorama = self._panorama(light.file)
            return backdrop.seen_panorama(panorama, camera, light.turn_deg, light.scale, WHITE)
        plain = np.array(look.background, np.float32)  # no environment was drawn that could be seen
        return np.broadcast_to(to_linear(plain), (camera.height, camera.width, 3))

    def composed(self, head: np.ndarray, corner: tuple[int, int], view: View) -> np.ndarray:
        """A rendered head before its backdrop, float32 [H, W, 3], linear.

        head: of some pixels, as for backdrop.before. corner: column and row of its upper left.
        """
        whole = np.array(self.behind(view))
        left, top = corner
        there = whole[top : top + head.shape[0], left : left + head.shape[1]]
        there[...] = backdrop.before(head.astype(np.float32), there)
        return whole

    def _light(self, look: Look) -> EnvironmentLight | None:
        if look.environment == NOTHING:
            return None
        path = self._path("environments", look.environment)
        if str(path) not in self._irradiance:
            self._irradiance[str(path)] = irradiance(self._panorama(str(path)))
        given = self._irradiance[str(path)].turned(look.environment_yaw_deg)
        face = given.facing
        scale = float(f"{look.environment_strength / (face @ LUMINANCE):.9g}")
        return EnvironmentLight(
            tuple(_rounded(colour) for colour in terms(given.form) * scale),
            _rounded(face * scale * LEAST),
            _rounded(given.direction),
            _rounded(given.sun * scale),
            str(path),
            look.environment_yaw_deg,
            scale,
        )

    def _panorama(self, path: str) -> np.ndarray:
        return _kept(self._panoramas, Path(path), read_panorama)

    def _path(self, kind: str, name: str) -> Path:
        if kind not in self._files:
            folder, suffixes = getattr(self._folders, kind), PANORAMAS if kind == "environments" else PICTURES
            self._files[kind] = _checked(
                lambda: named_files(
                    Path(folder) if folder else packaged_panoramas(), suffixes, f"render.{kind}"
                )
            )
        if name not in self._files[kind]:
            raise HeadError(f"render.{kind}: {name!r} is there no more")
        return self._files[kind][name]


def _kept(kept: OrderedDict[str, np.ndarray], path: Path, read: Callable[[Path], np.ndarray]) -> np.ndarray:
    key = str(path)
    if key not in kept:
        kept[key] = _checked(lambda: read(path))
        while len(kept) > KEPT:
            kept.popitem(last=False)
    kept.move_to_end(key)
    return kept[key]


def _checked(make: Callable[[], T]) -> T:
    """In a lane, a file that is not as the build found it costs the heads that need it."""
    try:
        return make()
    except UsageError as error:
        raise HeadError(str(error)) from error


def _rounded(colour: np.ndarray) -> tuple[float, float, float]:
    """Float32 has no more digits, and processors may differ in those of float64."""
    r, g, b = (float(f"{value:.7g}") for value in colour.tolist())
    return r, g, b
