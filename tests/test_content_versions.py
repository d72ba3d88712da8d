# SPDX-License-Identifier: GPL-3.0-or-later
"""What decides content, and what is only told."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError
from importlib.metadata import version as installed

import pytest

from generator import __version__, content
from generator.content import CONTENT, LIBRARIES, RELEASE, content_versions, deciding


@pytest.fixture(autouse=True)
def _fresh() -> Iterator[None]:
    """Versions are looked up once a process; these tests look again, and leave nothing behind."""
    content._version.cache_clear()
    yield
    content._version.cache_clear()


def test_everything_that_decides_content_is_named() -> None:
    found = content_versions(blender="4.5.15", detector="mediapipe 0.10.21")
    assert list(found) == [RELEASE, CONTENT, "blender", "detector", *LIBRARIES]
    assert (found["blender"], found["detector"]) == ("4.5.15", "mediapipe 0.10.21")
    assert found[RELEASE] == __version__ and found[CONTENT] == str(content.CONTENT_VERSION)
    assert found["numpy"] == installed("numpy")


def test_the_release_is_only_told() -> None:
    found = content_versions(blender="b", detector="d")
    assert deciding(found) == {name: value for name, value in found.items() if name != "headturn"}
    assert deciding({}) == {}


def test_what_is_not_installed_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    def version(name: str) -> str:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(content, "version", version)
    assert {content_versions(blender="b", detector="d")[name] for name in LIBRARIES} == {"none"}


@pytest.mark.parametrize("distribution", ["opencv-contrib-python", "opencv-python", "opencv-python-headless"])
def test_opencv_is_its_own_version_whichever_wheel_it_came_in(
    monkeypatch: pytest.MonkeyPatch, distribution: str
) -> None:
    """As datasets of the first release have it, which asked OpenCV itself."""

    def version(name: str) -> str:
        if name == distribution:
            return "4.11.0.86"
        raise PackageNotFoundError(name)

    monkeypatch.setattr(content, "version", version)
    assert content_versions(blender="b", detector="d")["opencv"] == "4.11.0"


def test_opencv_says_the_same_itself() -> None:
    cv2 = pytest.importorskip("cv2")
    assert content_versions(blender="b", detector="d")["opencv"] == cv2.__version__
