# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head source knows about a head before anything is loaded."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

NEUTRAL = "neutral"

SCENE = "blend"
"""The source of a head in a Blender scene."""

SCENE_SUFFIX = ".blend"


def is_scene(path: str | Path) -> bool:
    """Whether it is the path of a Blender scene, by its ending."""
    return Path(path).suffix.lower() == SCENE_SUFFIX


@dataclass(frozen=True)
class Head:
    """One expression of one subject, on disk.

    subject, expression: identity as strings, never a path; expression is
        "neutral" where the source has only one mesh a subject.
    source: "parametric", "facescape", "mesh" or SCENE.
    mesh_path: the mesh file. files: every file that decides the result,
        mesh first, then materials and textures.
    license: SPDX id or the source's own words; "unknown" if it says nothing.
    redistributable: may rendered images be published?
    units: "mm", "cm", "dm" or "m"; None means guess from the size of the face.
    up, forward: axes of the mesh such as "+Y" and "+Z"; None means guess.
    problems: what is wrong but does not stop the head from being built.
    eye_distance_mm: between the outer eye corners, where it decides the scale; see
        :func:`generator.heads.units.scale_of`. without: materials that are left out.
    head_object, shape_key: of a Blender scene, the object or collection that is the head, and the shape key
        that makes the expression; "" for the scene as it stands.
    """

    subject: str
    expression: str
    source: str
    mesh_path: Path
    files: tuple[Path, ...]
    license: str = "unknown"
    redistributable: bool = False
    attribution: str = ""
    units: str | None = None
    up: str | None = None
    forward: str | None = None
    problems: tuple[str, ...] = ()
    eye_distance_mm: float | None = None
    without: tuple[str, ...] = ()
    head_object: str = ""
    shape_key: str = ""

    @property
    def name(self) -> str:
        """subject/expression, for messages."""
        return f"{self.subject}/{self.expression}"


@dataclass(frozen=True)
class SkippedHead:
    """A head the source names but cannot give, and why."""

    subject: str
    expression: str
    path: Path
    reason: str


@dataclass(frozen=True)
class HeadSource:
    """Everything found under one path."""

    path: Path
    kind: str
    heads: tuple[Head, ...]
    skipped: tuple[SkippedHead, ...] = ()


@dataclass(frozen=True)
class Finder:
    """A kind of head source on disk.

    find: what lies under a path: heads, and what cannot be given with its reason; neither where it is
        no such source. Meshes are not parsed.
    license: of all its heads, where that is fixed.
    choose: as find, where the user may name what of a path is the head; None where there is nothing to name.
    """

    find: Callable[[Path], tuple[list[Head], list[SkippedHead]]]
    license: str = ""
    choose: Callable[[Path, str], tuple[list[Head], list[SkippedHead]]] | None = None


@dataclass(frozen=True)
class Made:
    """Heads that were asked for, of those that lie in a folder of made heads."""

    subjects: tuple[str, ...]
    expressions: tuple[str, ...]


@dataclass(frozen=True)
class Wish:
    """Which heads are to be made. argument: what stands behind the maker's name, such as a path.

    workers: processes that may make them; None for one a core. keep: may heads that are there as they
        were made stay?
    """

    argument: str
    count: int
    seed: int
    sampled_expressions: int
    workers: int | None = None
    keep: bool = True


@dataclass(frozen=True)
class Maker:
    """A kind of head source that is made on the spot.

    make: writes the heads of a wish into a folder, which may hold some already, and calls the
        function once a head.
    """

    make: Callable[[Path, Wish, Callable[[], None]], Made]
