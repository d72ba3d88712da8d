# SPDX-License-Identifier: GPL-3.0-or-later
"""Which processor Cycles renders on: this machine's CPU, or one of its GPUs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

BACKENDS = ("OPTIX", "CUDA", "HIP", "ONEAPI", "METAL")
"""Of Cycles. A GPU of NVIDIA's has two, and the first is the quicker one."""


@dataclass(frozen=True)
class Gpu:
    """A GPU as Cycles knows it."""

    backend: str
    name: str
    id: str

    def __str__(self) -> str:
        return f"{self.name} ({self.backend})"


def gpus(preferences: Any = None) -> list[Gpu]:
    """Those that this Blender can render on here, in Cycles' order.

    preferences: of Cycles; by default this Blender's.
    """
    asked = preferences or _preferences()
    asked.refresh_devices()
    there = {choice[0] for choice in asked.get_device_types(bpy.context)}
    for backend in BACKENDS:
        if backend in there:
            entries = [one for one in asked.get_devices_for_type(backend) if one.type == backend]
            if entries:
                return [Gpu(backend, one.name, one.id) for one in entries]
    return []


class Device:
    """What a render worker renders on.

    gpu: None for the CPU; else the number of the lane, which takes its turn among the GPUs that are here.
    Where there is none it is the CPU, and says so.
    """

    def __init__(self, gpu: int | None = None, preferences: Any = None) -> None:
        self._preferences = preferences
        found = [] if gpu is None else gpus(preferences)
        self._gpu = found[gpu % len(found)] if gpu is not None and found else None

    def __str__(self) -> str:
        """Its name; empty for the CPU."""
        return "" if self._gpu is None else str(self._gpu)

    def use(self, scene: bpy.types.Scene) -> None:
        """Have a scene rendered on it. Preferences too: factory settings know no GPU."""
        scene.cycles.device = "CPU" if self._gpu is None else "GPU"
        if self._gpu is None:
            return
        preferences = self._preferences or _preferences()
        if preferences.compute_device_type != self._gpu.backend:
            preferences.refresh_devices()
            preferences.compute_device_type = self._gpu.backend
        for one in preferences.devices:
            one.use = (one.type, one.id) == (self._gpu.backend, self._gpu.id)


def _preferences() -> Any:
    return bpy.context.preferences.addons["cycles"].preferences
