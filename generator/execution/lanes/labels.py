# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads that say what their parts are, where a pass or a view asks for it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh
from generator.heads.parametric.label_map import write_label_map
from generator.labels import SKIN
from generator.landmarks.labelling import labelled, name_label
from generator.plan.settings import PARAMETRIC
from generator.plan.views import Views

LABEL_MAP = "labels.png"


def asks_labels(views: Views) -> bool:
    """Does a view ask what is an eye or a lip? Gloss does: so the passes of a view change no image."""
    return any(look.gloss > 0 for look in views.looks)


def labelled_head(head: Head, mesh: HeadMesh, points: np.ndarray, folder: Path | None) -> HeadMesh:
    """A head whose materials say what they are.

    mesh: frame U, mm. points: float [P, 3], its anchors, frame C, mm. folder: for an image that says it texel
    by texel, of heads whose maker knows that; None, where materials are enough.
    """
    if head.source != PARAMETRIC:
        return labelled(mesh, points @ CAMERA_FROM_GRAPHICS)
    named = [replace(material, label=name_label(material)) for material in mesh.materials]
    if folder is not None:
        target = folder / LABEL_MAP
        write_label_map(head, target)
        named = [replace(one, label_map=target) if one.label == SKIN else one for one in named]
    return replace(mesh, materials=tuple(named))
