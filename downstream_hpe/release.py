# SPDX-License-Identifier: MIT
"""Which release this is, as pip knows it, and how pip is told to bring what is missing."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

from litert_faces.installing import install_command

DISTRIBUTIONS = ("downstream-hpe", "headturn")
"""What may have brought this package along: its release, or a checkout, which is installed as one."""


def _installed() -> tuple[str, str]:
    for name in DISTRIBUTIONS:
        try:
            return name, version(name)
        except PackageNotFoundError:
            continue
    return DISTRIBUTIONS[0], "0+not.installed"  # a checkout that is only on the path


DISTRIBUTION, __version__ = _installed()


def install(extra: str) -> str:
    """The command that brings an extra along. Import it where it is said: importlib.metadata takes a tenth of
    the time of all imports."""
    return install_command(extra, DISTRIBUTION)


def install_detector() -> str:
    """What helps where MediaPipe, or OpenCV, which comes with both detectors, is missing."""
    return f"{install('pose')} on Python 3.10 to 3.12, else {install('litert')}"
