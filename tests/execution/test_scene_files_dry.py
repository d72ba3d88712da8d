# SPDX-License-Identifier: GPL-3.0-or-later
"""Files outside of a .blend are told with it: when one changes, nothing goes on as if it had not."""

from __future__ import annotations

from pathlib import Path

import pytest
from dry_build import DryBuild
from replaying import Lanes

from generator.dataset.format.heads_table import read_heads, write_heads
from generator.errors import DatasetError, HeadError
from generator.execution.replay import replay_sample
from generator.heads import blend

NAME = "anna/neutral/y+10_p+0_r+10"


@pytest.fixture
def scene(dry: DryBuild, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> DryBuild:
    """A .blend with a texture beside it and a library elsewhere, as Blender would tell of it."""
    dry.heads = tmp_path / "shot" / "anna.blend"
    files = [tmp_path / "shot" / "skin.png", tmp_path / "library" / "eyes.blend"]
    for file in (dry.heads, *files):
        file.parent.mkdir(exist_ok=True)
        file.write_bytes(b"BLENDER-v405")
    said = {"error": "", "head_object": "Head", "shape_keys": [], "problems": []}
    monkeypatch.setattr(blend, "_described", lambda *_: {**said, "files": [str(file) for file in files]})
    dry.build()
    return dry


def test_they_are_in_the_table_and_the_same_ones_change_nothing(scene: DryBuild, again: Lanes) -> None:
    [row] = read_heads(scene.root)
    assert [path for path, _ in row.file_sha256] == ["anna.blend", "skin.png", "../library/eyes.blend"]
    scene.build()
    assert not scene.rendered
    assert replay_sample(scene.root, NAME).differences == ("the image differs",), "none was stored"


@pytest.mark.parametrize("name", ["skin.png", "../library/eyes.blend"])
def test_one_that_changed_is_named(scene: DryBuild, again: Lanes, name: str) -> None:
    (scene.heads.parent / name).write_bytes(b"painted anew")
    with pytest.raises(HeadError, match=rf"{name}: was changed after the build \(SHA-256 differs\); repl"):
        replay_sample(scene.root, NAME)
    with pytest.raises(DatasetError, match=rf"2 parts .* \({name} was changed since\) will be deleted; n"):
        scene.build()
    scene.build(confirm=lambda what: True)
    assert len(scene.rendered) == 6


def test_one_that_is_gone_is_named(scene: DryBuild, again: Lanes) -> None:
    (scene.heads.parent / "skin.png").unlink()
    with pytest.raises(HeadError, match=r"skin\.png: a file of anna/neutral is gone; give the place"):
        replay_sample(scene.root, NAME)


@pytest.mark.parametrize("path", ["/etc/passwd", "a/../../b", "..", "../", "C:/a", "../C:/a"])
def test_a_stranger_s_table_names_files_from_the_blend_on(scene: DryBuild, path: str) -> None:
    [row] = read_heads(scene.root)
    object.__setattr__(row, "file_sha256", ((path, "0" * 64),))
    write_heads([row], scene.root)
    with pytest.raises(DatasetError, match="is no path inside the folder of the heads"):
        read_heads(scene.root)
