# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads of three sources to fit things to: parametric, FaceScape's layout, ICT-FaceKit's layout."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from where import SOURCES

if TYPE_CHECKING:
    from generator.execution.lanes.renderer import Renderer
    from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh
    from generator.worn.fit import Fit

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "heads"))


@pytest.fixture(scope="session")
def fits(
    parametric_heads: Path,
    renderer: Renderer,
    detector: MediaPipeFaceMesh,
    tmp_path_factory: pytest.TempPathFactory,
) -> dict[str, Fit]:
    """A head of each of SOURCES, placed as a build places it."""
    from facescape_fixture import write_subject
    from ict_fixture import write_light

    from generator.geometry.rotation import CAMERA_FROM_GRAPHICS
    from generator.heads.ict.make import make_ict_heads
    from generator.heads.read import read_mesh
    from generator.heads.source import find_heads
    from generator.landmarks.shared import packaged
    from generator.placing.placer import Placer
    from generator.worn.fit import Fit

    folder = tmp_path_factory.mktemp("worn")
    write_subject(folder / "facescape" / "122" / "models_reg")
    make_ict_heads(folder / "ict", str(write_light(folder / "kit")), count=1, seed=2)
    scratch = folder / "scratch"
    scratch.mkdir()

    def placed(source: Path) -> Fit:
        head = find_heads(source).heads[0]
        mesh = read_mesh(head, scratch)
        placer = Placer(
            renderer, detector, scratch, lambda head: read_mesh(head, scratch), packaged(detector.topology)
        )
        found = placer.subject([head], "level")
        anchors = found.facts[0].anchors
        assert anchors is not None
        levelled = anchors.points @ CAMERA_FROM_GRAPHICS @ found.placement.levelling.T
        return Fit(found.placement.normalise(mesh), levelled)

    places = (parametric_heads, folder / "facescape", folder / "ict")
    return dict(zip(SOURCES, map(placed, places), strict=True))
