# SPDX-License-Identifier: GPL-3.0-or-later
"""A texture is decoded once as long as it stays what it is."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from generator.errors import HeadError
from generator.heads import textures
from generator.heads.textures import Textures

SQUARE = np.array([[[0, 0], [1, 0], [0, 1]]], dtype=float)


@pytest.fixture
def decoded(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The modes of the images that were decoded."""
    modes: list[str] = []
    original = textures._alpha

    def counted(image: Image.Image) -> np.ndarray | None:
        modes.append(image.mode)
        return original(image)

    monkeypatch.setattr(textures, "_alpha", counted)
    return modes


def test_a_solid_texture_is_decoded_once(tmp_path: Path, decoded: list[str]) -> None:
    path = tmp_path / "skin.png"
    Image.new("RGB", (40, 30), "red").save(path)
    for _ in range(3):
        head = Textures()
        head.check(path)
        assert not head.has_holes(path, SQUARE)
    assert decoded == ["RGB"]


def test_a_texture_that_changed_is_looked_at_again(tmp_path: Path, decoded: list[str]) -> None:
    path = tmp_path / "skin.png"
    Image.effect_noise((64, 64), 50).convert("RGB").save(path)
    Textures().check(path)
    whole = path.read_bytes()
    Image.new("RGBA", (64, 64)).save(path)
    Textures().check(path)
    Textures().check(path)
    assert decoded == ["RGB", "RGBA", "RGBA"], "of what is not solid the alpha is needed"
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(HeadError, match="broken"):
        Textures().check(path)


def test_few_are_remembered(tmp_path: Path, decoded: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(textures, "_MOST_SOLID", 3)
    monkeypatch.setattr(textures, "_SOLID", {})
    for name in "abcdefgh":
        Image.new("RGB", (4, 4)).save(tmp_path / f"{name}.png")
        Textures().check(tmp_path / f"{name}.png")
        assert len(textures._SOLID) <= 3
