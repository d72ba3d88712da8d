# SPDX-License-Identifier: GPL-3.0-or-later
"""What decides the content of a dataset besides its configuration and its heads."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version

from generator import __version__

CONTENT_VERSION = 3
"""Raise it when pixels or labels of a build change though its configuration does not; a release alone
changes nothing. Units that were built by another content version are built again."""

RELEASE, CONTENT = "headturn", "content"
"""Keys of the versions of a dataset: the release, which is only told, and the content version."""

LIBRARIES = ("numpy", "opencv", "embreex", "trimesh", "OpenEXR")
"""Libraries that decide content, besides Blender and the detector."""

_DISTRIBUTIONS = {"opencv": ("opencv-contrib-python", "opencv-python", "opencv-python-headless")}


def content_versions(*, blender: str, detector: str) -> dict[str, str]:
    """Name and version of everything that decides content, and of this release."""
    return {
        RELEASE: __version__,
        CONTENT: str(CONTENT_VERSION),
        "blender": blender,
        "detector": detector,
        **{name: _version(name) for name in LIBRARIES},
    }


def deciding(versions: Mapping[str, str]) -> dict[str, str]:
    """Those that enter the names of units: all but the release."""
    return {name: value for name, value in versions.items() if name != RELEASE}


@cache
def _version(name: str) -> str:
    for distribution in _DISTRIBUTIONS.get(name, (name,)):
        try:
            found = version(distribution)
        except PackageNotFoundError:
            continue
        # The wheel's version is OpenCV's own with a number behind it.
        return ".".join(found.split(".")[:3]) if name == "opencv" else found
    return "none"
