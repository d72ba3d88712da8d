# SPDX-License-Identifier: GPL-3.0-or-later
"""A view: what decides an image besides its head. numpy and stdlib only: the render worker reads it.

A plan is heads x views. Everything may differ from one image to the next: the pose, the camera, the look.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TypeVar, overload

import numpy as np

from generator.geometry.camera import Camera
from generator.plan.settings import Look

T = TypeVar("T")

Pose = tuple[float, float, float]
"""(yaw, pitch, roll) in degrees."""


@dataclass(frozen=True)
class View:
    """One image of a head: at which pose, through which camera, with which look.

    seed: of what is random in it, such as noise.
    """

    pose: Pose
    camera: Camera
    look: Look
    seed: int = 0


@dataclass(frozen=True)
class Views(Sequence[View]):
    """Some views in order; what all of them share stands here once.

    poses: one a view. cameras, looks, seeds: one a view, or a single one for all.
    Raises ValueError if there is another number of them.
    """

    poses: tuple[Pose, ...]
    cameras: tuple[Camera, ...]
    looks: tuple[Look, ...]
    seeds: tuple[int, ...] = (0,)

    def __post_init__(self) -> None:
        for name in ("cameras", "looks", "seeds"):
            count = len(getattr(self, name))
            if count not in (1, len(self.poses)):
                raise ValueError(f"{name}: expected 1 or {len(self.poses)}, got {count}")

    @classmethod
    def of(cls, views: Sequence[View]) -> Views:
        """Views put together, with what they share said once."""
        return cls(
            tuple(view.pose for view in views),
            _once([view.camera for view in views]),
            _once([view.look for view in views]),
            _once([view.seed for view in views]),
        )

    def __len__(self) -> int:
        return len(self.poses)

    @overload
    def __getitem__(self, place: int) -> View: ...

    @overload
    def __getitem__(self, place: slice) -> Views: ...

    def __getitem__(self, place: int | slice) -> View | Views:
        if isinstance(place, slice):
            cameras = self.cameras if len(self.cameras) == 1 else self.cameras[place]
            looks = self.looks if len(self.looks) == 1 else self.looks[place]
            seeds = self.seeds if len(self.seeds) == 1 else self.seeds[place]
            return Views(self.poses[place], cameras, looks, seeds)
        pose = self.poses[place]  # raises IndexError past the end, which ends a loop
        camera = self.cameras[place if len(self.cameras) > 1 else 0]
        look = self.looks[place if len(self.looks) > 1 else 0]
        return View(pose, camera, look, self.seeds[place if len(self.seeds) > 1 else 0])

    def __iter__(self) -> Iterator[View]:
        return (self[place] for place in range(len(self)))

    @property
    def angles_deg(self) -> np.ndarray:
        """float64 [N, 3], (yaw, pitch, roll)."""
        return np.array(self.poses, dtype=np.float64).reshape(-1, 3)


def _once(values: list[T]) -> tuple[T, ...]:
    first = values[:1]
    return tuple(first) if all(value == first[0] for value in values) else tuple(values)
