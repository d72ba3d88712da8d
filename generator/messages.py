# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that host, lanes and render workers say to each other: one JSON object a line.

``to_json`` and ``from_json`` are the only way in and out. numpy and stdlib only: a render worker
runs inside Blender.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal, TypeVar

import numpy as np

from generator.codec import from_plain, to_plain
from generator.dataset.format.part_info import PartInfo
from generator.heads.head import Head
from generator.heads.placement import Placement
from generator.landmarks.anchors import Anchors
from generator.landmarks.shared import SharedAnchors
from generator.plan.environment_light import EnvironmentLight
from generator.plan.factors import part_folder
from generator.plan.settings import Landmarks
from generator.plan.views import Views
from generator.plan.wear import Worn

T = TypeVar("T")

# From a lane to its render worker.


@dataclass(frozen=True)
class RenderOrder:
    """Render a packaged head as each view says.

    package: of :func:`generator.heads.package.save_package`. out: a folder for the images.
    passes: render these instead of the picture, see :mod:`generator.plan.passes`.
    lights: of the environment of each view; none where no view has one.
    worn: by the head in each view; none where it wears nothing in any.
    A view with a backdrop is rendered as .exr over nothing, linear with alpha, whatever the format.
    """

    package: str
    views: Views
    out: str
    format: Literal["bmp", "exr"] = "bmp"
    passes: tuple[str, ...] = ()
    lights: tuple[EnvironmentLight | None, ...] = ()
    worn: tuple[tuple[Worn, ...], ...] = ()


@dataclass(frozen=True)
class ConvertOrder:
    """Read a mesh file with Blender's importer for its kind and write it as GLB."""

    source: str
    target: str


@dataclass(frozen=True)
class SceneOrder:
    """Open a .blend and write the surface of its head as a package, and what was noticed as JSON beside it.

    head_object, shape_key: of :class:`generator.heads.head.Head`.
    """

    source: str
    target: str
    head_object: str
    shape_key: str = ""


# From a render worker.


@dataclass(frozen=True)
class WorkerReady:
    """The first thing a worker says. version: of its Blender. device: its GPU; empty for the CPU."""

    version: str
    device: str = ""


@dataclass(frozen=True)
class Rendered:
    """The image of one view lies at path.

    box: the pixels of the view that it holds, as first and last + 1 column and the same for rows, counted
    from the bottom; None if it holds all.
    """

    view: int
    path: str
    box: tuple[int, int, int, int] | None = None


@dataclass(frozen=True)
class OrderDone:
    """An order was carried out."""


@dataclass(frozen=True)
class OrderFailed:
    """An order was not; the worker goes on. reason: one line."""

    reason: str


# From the host to a lane.


@dataclass(frozen=True)
class VersionsOrder:
    """Say what in you decides content."""

    landmarks: Landmarks = field(default_factory=Landmarks)


@dataclass(frozen=True)
class PlaceOrder:
    """Find the face of a subject and anchor its landmarks.

    heads: of one subject, the one that decides pose zero first. frame: see Placement. shared: anchors of
    topologies that this dataset's heads have in common, besides those of the package.
    """

    heads: tuple[Head, ...]
    frame: str
    landmarks: Landmarks = field(default_factory=Landmarks)
    shared: tuple[SharedAnchors, ...] = ()


@dataclass(frozen=True)
class ShareOrder:
    """Find the anchors of every topology that two or more heads have in common.

    heads: one a subject. placed: what placing each alone found.
    """

    heads: tuple[Head, ...]
    placed: tuple[Placed, ...]
    landmarks: Landmarks = field(default_factory=Landmarks)


@dataclass(frozen=True)
class BuildOrder:
    """Render one unit, a head at some views; detect, and commit its part.

    unit: its name. earlier_units: names it had when its poses had another place in the grid.
    root: the dataset. indices: place of each view's pose in the grid.
    anchors: float64 [P, 3], frame C at the pose zero of the dataset, mm; NaN where there is none.
    configuration_digest: of what all parts of the dataset share.
    environments, pictures, things: folders as in :class:`generator.picture.scenery.Folders`.
    factor: the views are twins, with this one changed.
    """

    unit: str
    head: Head
    root: str
    views: Views
    indices: tuple[tuple[int, int, int], ...]
    placement: Placement
    anchors: np.ndarray
    split: str
    images: str
    image_format: str
    passes: tuple[str, ...] = ()
    landmarks: Landmarks = field(default_factory=Landmarks)
    configuration_digest: str = ""
    earlier_units: tuple[str, ...] = ()
    environments: str = ""
    pictures: str = ""
    things: str = ""
    factor: str = ""

    @property
    def part_path(self) -> str:
        """Where its part lies, relative to the dataset."""
        return part_path(self.split, self.unit, self.factor)

    @property
    def earlier_paths(self) -> tuple[str, ...]:
        """Where it may lie under an earlier name."""
        return tuple(part_path(self.split, unit, self.factor) for unit in self.earlier_units)


def part_path(split: str, unit: str, factor: str = "") -> str:
    """Where the part of a unit lies, relative to the dataset. factor: of twins."""
    return f"{part_folder(factor)}/{split}/part-{unit}.parquet"


# From a lane.


@dataclass(frozen=True)
class LaneReady:
    """The first thing a lane in a process of its own says."""

    pid: int


@dataclass(frozen=True)
class Progressed:
    """One image is done."""


@dataclass(frozen=True)
class Versions:
    """Name and version of everything in a lane that decides content."""

    versions: dict[str, str]


@dataclass(frozen=True)
class HeadFacts:
    """What reading and anchoring one head found, or the reason why it cannot be built."""

    vertices: int = 0
    triangles: int = 0
    problems: tuple[str, ...] = ()
    anchors: Anchors | None = None
    error: str = ""


@dataclass(frozen=True)
class Placed:
    """Where a subject stands, and what was found of each of its heads, in the order's order."""

    placement: Placement
    facts: tuple[HeadFacts, ...]


@dataclass(frozen=True)
class Shared:
    """The anchors of topologies, as a :class:`ShareOrder` wanted them."""

    anchors: tuple[SharedAnchors, ...]


@dataclass(frozen=True)
class Built:
    """A unit was committed. seconds: of the lane, a stage. versions: as :class:`Versions`."""

    part: PartInfo
    seconds: dict[str, float]
    versions: dict[str, str]


@dataclass(frozen=True)
class LaneFailed:
    """An order was not carried out. kind: a class of :mod:`generator.errors`. log: see WorkerError."""

    reason: str
    kind: str
    log: str = ""


LaneOrder = VersionsOrder | PlaceOrder | ShareOrder | BuildOrder
Receipt = Versions | Placed | Shared | Built

_KINDS: dict[str, type] = {
    kind.__name__: kind
    for kind in (
        *(RenderOrder, ConvertOrder, SceneOrder, WorkerReady, Rendered, OrderDone, OrderFailed),
        *(VersionsOrder, PlaceOrder, ShareOrder, BuildOrder),
        *(LaneReady, Progressed, Versions, Placed, Shared, Built, LaneFailed),
    )
}


def to_json(message: Any) -> dict[str, Any]:
    """A message as plain values; "is" names its kind."""
    return {"is": type(message).__name__, **to_plain(message)}


def from_json(values: dict[str, Any]) -> Any:
    """The inverse of :func:`to_json`. Raises ValueError or TypeError for what is no message."""
    kind = _KINDS.get(values.get("is", "")) if isinstance(values, dict) else None
    if kind is None:
        raise ValueError(f"no message: {str(values)[:80]}")
    return from_plain(kind, {key: value for key, value in values.items() if key != "is"})


def expect(kind: type[T], message: Any) -> T:
    """The message, which must be of a kind. Raises TypeError if it is not."""
    if not isinstance(message, kind):
        raise TypeError(f"expected {kind.__name__}, got {type(message).__name__}")
    return message
