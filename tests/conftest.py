# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads and processes that several test folders share."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest
from placed_head import PlacedHead

from generator.execution.lanes.renderer import Renderer
from generator.heads.parametric.make import make_heads
from generator.heads.read import read_mesh
from generator.heads.source import find_heads
from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh
from generator.placing.face import find_face

SHARED_HEADS = Path(__file__).resolve().parents[2] / "shared" / "heads"


@pytest.fixture(scope="session", autouse=True)
def _interruptible() -> None:
    """Ctrl-C works in what the tests start, even where they run in the background and it is ignored."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(scope="session")
def shared_heads() -> Path:
    """Two real heads that lie beside the checkout of a developer."""
    if not SHARED_HEADS.is_dir():
        pytest.skip("the two example heads are not on this machine")
    return SHARED_HEADS


@pytest.fixture(scope="session")
def parametric_heads(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two parametric identities, neutral only."""
    folder = tmp_path_factory.mktemp("parametric") / "heads"
    make_heads(folder, count=2, seed=1)
    return folder


@pytest.fixture(scope="session")
def renderer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Renderer]:
    """One render worker (the bpy wheel) for everything that needs a frame."""
    folder = tmp_path_factory.mktemp("frames")
    worker = Renderer(folder, folder / "render.log")
    yield worker
    worker.close()


@pytest.fixture(scope="session")
def detector() -> Iterator[MediaPipeFaceMesh]:
    """The real detector."""
    mesh = MediaPipeFaceMesh()
    yield mesh
    mesh.close()


@pytest.fixture(scope="session")
def placed_head(
    parametric_heads: Path,
    renderer: Renderer,
    detector: MediaPipeFaceMesh,
    tmp_path_factory: pytest.TempPathFactory,
) -> PlacedHead:
    """The first parametric head in frame U, mm, pivot at the origin."""
    scratch = tmp_path_factory.mktemp("placed")
    head = find_heads(parametric_heads).heads[0]
    mesh = read_mesh(head, scratch)
    placement = find_face(head, mesh, renderer, detector, scratch)
    return PlacedHead(head, placement, placement.normalise(mesh))
