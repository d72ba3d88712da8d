# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes: what the camera sees of the geometry, pixel by pixel. stdlib only: Blender reads it too.

A new one is an object here and a line in :data:`generator.registries.PASSES`.
"""

from __future__ import annotations

from dataclasses import dataclass

from generator.labels import LABELS

PAINTED = ""
"""The switch of passes that are rendered with materials of their own."""

PAINTED_SAMPLES = 8
"""Of which each pixel of theirs is the mean."""


@dataclass(frozen=True)
class Pass:
    """One pass.

    name: of its layer in our files.
    switch: the property of Blender's view layer that turns it on; the same in Blender 4.2 to 5.x. PAINTED:
        it is painted, with materials that show it instead of light, and averaged over the pixel.
    layers: what Blender calls its layer: 4.x, then 5.x where it differs.
    channels: of our layer. axes: for each of them, the names that Blender's channel may have.
    turned: x, y, z are turned from Blender's frame B to frame C.
    from_pivot: the origin is moved from the pivot, which Blender's world has, to the camera.
    empty: what pixels without a surface hold.
    meaning: one line for people, Markdown.
    """

    name: str
    switch: str
    layers: tuple[str, ...]
    channels: tuple[str, ...]
    axes: tuple[tuple[str, ...], ...]
    meaning: str
    turned: bool = False
    from_pivot: bool = False
    empty: float = float("nan")

    @property
    def channel_names(self) -> tuple[str, ...]:
        """Full names of its channels in our files, such as "depth.Z"."""
        return tuple(f"{self.name}.{channel}" for channel in self.channels)


_XYZ = (("X",), ("Y",), ("Z",))

DEPTH = Pass(
    "depth",
    "use_pass_z",
    ("Depth",),
    ("Z",),
    (("Z", "V"),),
    "along the camera's axis (not along the ray), **metres**",
)
POSITION = Pass(
    "position",
    "use_pass_position",
    ("Position",),
    ("X", "Y", "Z"),
    _XYZ,
    "of the surface, frame C, **metres**: 1000 times this compares with `landmarks_exact`",
    turned=True,
    from_pivot=True,
)
NORMAL = Pass(
    "normal",
    "use_pass_normal",
    ("Normal",),
    ("X", "Y", "Z"),
    _XYZ,
    "of the surface (smooth), frame C, length 1",
    turned=True,
)
UV = Pass(
    "uv",
    "use_pass_uv",
    ("UV",),
    ("U", "V"),
    (("U", "X"), ("V", "Y")),
    "the texture's own coordinates, v up; 0 on a mesh without",
)
OBJECT_INDEX = Pass(
    "object_index",
    "use_pass_object_index",
    ("IndexOB", "Object Index"),
    ("X",),
    (("X", "V"),),
    "1 on the head, 2 on what it wears, 3 on the rest of a Blender scene, 0 where there is nothing",
    empty=0.0,
)
"""Always rendered: where it is 0 there is no surface."""


BACKGROUND = "background"

ALBEDO = Pass(
    "albedo",
    PAINTED,
    (),
    ("R", "G", "B"),
    (),
    "colour of the surface without light, linear, mean over the pixel's share that is covered",
)
SEGMENTATION = Pass(
    "segmentation",
    PAINTED,
    (),
    (BACKGROUND, *LABELS),
    (),
    "share of the pixel that each class covers, 0 to 1; they add up to 1",
)

LABELS_A_PICTURE = 3
"""Classes that one picture of the render worker tells apart: by red, green and blue."""


def painted_file(stem: str, name: str, group: int = 0) -> str:
    """Name of the picture of a painted pass beside the multilayer file. group: of its classes."""
    return f"{stem}.{name}{group}.exr"
