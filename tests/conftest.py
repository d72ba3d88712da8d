# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads and processes that several test folders share, and which tests are slow.

Nothing that Blender, a detector or torch brings along is imported before a fixture is asked for it: so
the quick tests are collected and run where these are not installed.
"""

from __future__ import annotations

import os
import re
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import hypothesis
import pytest
from placed_head import PlacedHead

if TYPE_CHECKING:
    from generator.execution.lanes.renderer import Renderer
    from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh

SHARED_HEADS = Path(__file__).resolve().parents[2] / "shared" / "heads"

SLOW_FIXTURES = {
    *("parametric_heads", "renderer", "detector", "placed_head"),  # of this file
    *("blender_command", "host_python", "extension_zip"),  # of tests/addon
}
"""What starts a renderer or a detector, or takes seconds: every test that needs one is slow."""

# The same examples in every run, so that what was red stays red; --hypothesis-profile=search looks for
# others. No deadline: a busy machine is no fault of the code.
# A machine that is busy with something else makes inputs slowly: that is no fault of a test.
hypothesis.settings.register_profile(
    "same",
    derandomize=True,
    max_examples=20,
    deadline=None,
    database=None,
    suppress_health_check=[hypothesis.HealthCheck.too_slow],
)
hypothesis.settings.register_profile("search", max_examples=2000, deadline=None, print_blob=True)
hypothesis.settings.load_profile("same")


LONGER = frozenset((Path(__file__).parent / "longer.txt").read_text(encoding="utf-8").splitlines())
"""Modules, by their paths in the checkout, that are left out of the quick tests though they are not slow."""


@pytest.hookimpl(tryfirst=True)  # before -m chooses
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Mark every test as slow that needs a slow fixture, directly or not, and as quick if it is one."""
    for item in items:
        if SLOW_FIXTURES.intersection(getattr(item, "fixturenames", ())):
            item.add_marker(pytest.mark.slow)
        if item.get_closest_marker("slow") is None and item.nodeid.partition("::")[0] not in LONGER:
            item.add_marker(pytest.mark.quick)


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Files that are slow throughout are not even imported for the other tests: torch takes seconds."""
    if config.option.markexpr not in ("not slow", "quick") or collection_path.suffix != ".py":
        return None
    if (
        config.option.markexpr == "quick"
        and collection_path.relative_to(config.rootpath).as_posix() in LONGER
    ):
        return True
    text = collection_path.read_text(encoding="utf-8")
    return True if re.search(r"^pytestmark = \[?\s*pytest\.mark\.slow", text, re.MULTILINE) else None


@pytest.fixture(scope="session", autouse=True)
def _interruptible() -> None:
    """Ctrl-C works in what the tests start, even where they run in the background and it is ignored."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.fixture(autouse=True)
def _own_environment(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """What a command changes for its process (safe paths, for one) is not the next test's."""
    environment, path = dict(os.environ), list(sys.path)
    yield
    monkeypatch.undo()  # what it puts back comes first
    if os.environ != environment:
        os.environ.clear()
        os.environ.update(environment)
    sys.path[:] = path


@pytest.fixture(scope="session", autouse=True)
def _unsynced() -> Iterator[None]:
    """Nothing waits for the disk: what a test writes need not outlive the machine."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(os, "fsync", lambda handle: None)
        yield


@pytest.fixture(scope="session")
def shared_heads() -> Path:
    """Two real heads that lie beside the checkout of a developer."""
    if not SHARED_HEADS.is_dir():
        pytest.skip("the two example heads are not on this machine")
    return SHARED_HEADS


@pytest.fixture(scope="session")
def parametric_heads(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two parametric identities, neutral only."""
    from generator.heads.parametric.make import make_heads

    folder = tmp_path_factory.mktemp("parametric") / "heads"
    make_heads(folder, count=2, seed=1)
    return folder


@pytest.fixture(scope="session")
def renderer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Renderer]:
    """One render worker (the bpy wheel) for everything that needs a frame."""
    from generator.execution.lanes.renderer import Renderer

    folder = tmp_path_factory.mktemp("frames")
    worker = Renderer(folder, folder / "render.log")
    yield worker
    worker.close()


@pytest.fixture(scope="session")
def detector() -> Iterator[MediaPipeFaceMesh]:
    """The real detector."""
    from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh

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
    from generator.heads.read import read_mesh
    from generator.heads.source import find_heads
    from generator.placing.face import find_face
    from generator.placing.looking import Eyes

    scratch = tmp_path_factory.mktemp("placed")
    head = find_heads(parametric_heads).heads[0]
    mesh = read_mesh(head, scratch)
    placement = find_face(head, mesh, Eyes(renderer, detector, scratch))
    return PlacedHead(head, placement, placement.normalise(mesh))
