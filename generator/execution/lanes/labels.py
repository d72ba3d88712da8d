# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads that say what their parts are."""

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

LABEL_MAP = "labels.png"


def labelled_head(head: Head, mesh: HeadMesh, points: np.ndarray, folder: Path) -> HeadMesh:
    """A head whose materials say what they are.

    mesh: frame U, mm. points: float [P, 3], its anchors, frame C, mm. folder: for an image that says it texel
    by texel, of heads whose maker knows that.
    """
    if head.source != PARAMETRIC:
        return labelled(mesh, points @ CAMERA_FROM_GRAPHICS)
    target = folder / LABEL_MAP
    write_label_map(head, target)
    materials = [replace(material, label=name_label(material)) for material in mesh.materials]
    whole = [replace(one, label_map=target) if one.label == SKIN else one for one in materials]
    return replace(mesh, materials=tuple(whole))
