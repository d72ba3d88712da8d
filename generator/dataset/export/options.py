# SPDX-License-Identifier: GPL-3.0-or-later
"""What a format is, and what may be chosen about an export."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from generator.dataset.format.missing import Missing

if TYPE_CHECKING:
    from generator.dataset.export.source import Source

Landmarks = Literal["auto", "exact", "detected"]
"""Which landmarks: from the mesh, from the detector, or (auto) the mesh's if all heads have them."""

LANDMARKS: tuple[Landmarks, ...] = get_args(Landmarks)

OVERRIDE = "--i-may-publish-these-heads"

ImageFormat = Literal["jpg", "png"]
"""How an export writes its images, where its readers differ in what they look for."""

NEEDS_POINTS: tuple[Missing, ...] = ("fail", "skip", "exact")
"""Choices of a format that is nothing without landmarks."""


@dataclass(frozen=True)
class Format:
    """One form of an export; each module of this package has one, called FORMAT.

    write: writes the rows of a source into a folder; returns what README.md says about the format, or
        "" if it wrote one itself.
    readers, holds: for whom it is, and what is in it, for docs/exports.md; so are written (which
        rotation stands where) and back (how that gives R_C again).
    missing: the choices for rows without what the format needs; the first is the default.
    landmarks: does it hold any? They are the 68 points of iBUG. images: does it take images?
    boxes: does it hold a box around the face, see :mod:`generator.dataset.export.boxes`?
    image_formats: what --image-format may say; the first is the default. (): the format has one way.
    public: is it meant for publication?
    note: one line for whoever may have meant another format.
    """

    write: Callable[[Source, Path], str]
    readers: str
    holds: str
    written: str
    back: str
    missing: tuple[Missing, ...] = ("keep", "skip", "fail")
    landmarks: bool = False
    images: bool = True
    boxes: bool = False
    image_formats: tuple[ImageFormat, ...] = ()
    public: bool = False
    note: str = ""


@dataclass(frozen=True)
class ExportOptions:
    """missing = None and image_format = None take the format's own default.

    public: the export will be published, whatever its format.
    only_redistributable: leave out rows that may not be published.
    may_publish: the person who exports holds the right to publish all of them.
    """

    landmarks: Landmarks = "auto"
    missing: Missing | None = None
    image_format: ImageFormat | None = None
    public: bool = False
    only_redistributable: bool = False
    may_publish: bool = False
