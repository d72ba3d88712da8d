# SPDX-License-Identifier: GPL-3.0-or-later
"""What is said of a .blend: which head, which expressions, what is missing, and why it is refused."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from generator.errors import UsageError
from generator.geometry.scene_camera import SceneCamera
from generator.heads import blend
from generator.heads.source import find_heads


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("scenes")
    command = [sys.executable, str(Path(__file__).with_name("many_scenes.py")), str(made)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert (made / "cameras.json").exists(), done.stdout + done.stderr
    return made


@pytest.fixture(scope="module")
def said(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "said.json").read_text())
    return found


WHICH = "what is the head? name it with --head-object, or give it a custom property headturn_head"


@pytest.mark.slow
def test_the_head_is_the_one_named_or_tagged_or_the_only_one(said: dict[str, Any]) -> None:
    heads = {name: answer.get("head_object") for name, answer in said.items() if not answer["error"]}
    assert heads["two-named"] == "Floor"
    assert heads["tagged"] == "Anna"
    assert heads["alone"] == "Rig"
    assert heads["collection"] == "Head"
    assert heads["left out"] == "Anna"
    assert said["two"]["error"] == f"{WHICH}; there are: 'Anna', 'Floor'"
    assert (
        said["two-misnamed"]["error"]
        == "no object or collection 'Bob' in the scene; there are: 'Anna', 'Floor'"
    )
    assert said["both-tagged"]["error"] == "'Anna', 'Floor' are tagged headturn_head; tag one"
    assert said["empty"]["error"] == "there is no mesh in it that is rendered"


@pytest.mark.slow
def test_files_that_cannot_be_read_are_refused_in_a_line(said: dict[str, Any]) -> None:
    for name in ("cut-off", "text"):
        assert "cannot open it" in said[name]["error"] and "\n" not in said[name]["error"]
    # Another Blender may be named for rendering; what is in it can be told.
    assert said["newer"]["head_object"] == "Rig"


@pytest.mark.slow
def test_shape_keys_are_expressions_and_missing_files_are_said(said: dict[str, Any], folder: Path) -> None:
    source = find_heads(folder / "textured.blend")
    keys = {head.expression: head.shape_key for head in source.heads}
    assert keys == {"neutral": "", "smile": "smile", "a_b": "a/b", "a_b_2": "a:b", "neutral_2": "neutral"}
    assert {head.subject for head in source.heads} == {"textured"}
    assert source.heads[0].problems[0] == "'skin': a texture is missing, and rendered in magenta"


@pytest.mark.slow
def test_files_outside_of_it_that_pictures_show_are_told(said: dict[str, Any], folder: Path) -> None:
    """Not what is packed, nor sounds and texts; every frame and tile; what a library names, and itself."""
    names = [Path(file).relative_to(folder).as_posix() for file in said["scattered"]["files"]]
    images = [f"{name}.png" for name in ("hat.1001", "hat.1002", "skin", "walk_09", "walk_10")]
    shown = sorted([*images, "lamp.ies", "smoke.vdb"])
    cloth = "scenes/blendcache_scattered/cloth_000001_00.bphys"
    assert names == ["library.blend", cloth, *(f"textures/{name}" for name in shown)]
    [line] = said["scattered"]["problems"]
    assert line.endswith("textures/lost.vdb': missing, and rendered without")
    assert said["alone"]["files"] == said["alone"]["problems"] == []
    assert said["too many"]["files"] == []
    assert said["too many"]["problems"][1].startswith(
        "9 files outside of the .blend are too many to be told:"
    )


@pytest.mark.slow
def test_heads_turn_as_one_or_are_refused(folder: Path) -> None:
    turned = json.loads((folder / "turned.json").read_text())
    assert turned["held"]["error"] == (
        "'Lid' does not turn with the head: something else holds it; apply its modifiers, or parent what "
        "holds it to the head"
    )
    for name in ("held_inside", "displaced", "linked", "instanced", "mirrored"):
        assert turned[name]["error"] == "" and turned[name]["off"] < 1e-5, (name, turned[name])
    assert turned["simulated"]["problems"] == [
        "'Head': hair dynamics that are not baked are off; bake them in Blender"
    ]
    # Of a mirrored one up is up, and forward is forward, or no face is found.
    assert turned["mirrored"]["axes"] == [[0, -1, 0], [1, 0, 0], [0, 0, 1]]


@pytest.mark.slow
def test_a_material_of_the_head_moves_no_surface(folder: Path) -> None:
    turned = json.loads((folder / "turned.json").read_text())["displaced"]
    assert turned["methods"] == {"Skin": "BUMP", "Ground": "BOTH"}
    assert turned["problems"] == [
        "'Skin': displacement is rendered as bump, so that labels are where the surface is"
    ]


@pytest.mark.slow
def test_a_frozen_head_looks_as_blender_renders_it(folder: Path) -> None:
    """At the frame of the file, with what nodes make of hair, what vertices carry, and metaballs."""
    for name, seen in json.loads((folder / "looks.json").read_text()).items():
        assert seen["shown"] > 0.01 and seen["off"] < 0.05, (name, seen)


@pytest.mark.slow
def test_hair_of_particles_looks_alike_whatever_was_rendered_before(folder: Path) -> None:
    order = json.loads((folder / "order.json").read_text())
    assert order["shown"] > 0.01 and order["off"] == 0, order


@pytest.mark.slow
def test_what_one_sees_through_hides_nothing(folder: Path) -> None:
    said = json.loads((folder / "through.json").read_text())
    parts = {name: tuple(one["parts"]) for name, one in said.items()}
    seen, cut = ("seen", "all"), ("cut", "all")
    assert parts == {
        **dict.fromkeys(("solid", "solid group", "card", "one side"), seen),
        **dict.fromkeys(("glass", "clear group", "nearly clear", "no alpha", "fog", "indirect layer"), ()),
        **dict.fromkeys(("holdout", "holdout shader", "holdout layer"), cut),
    }
    assert [name for name, one in said.items() if one["cutout"]] == ["card"]
    assert [name for name, one in said.items() if one["unknown"]] == ["one side"]


@pytest.mark.slow
def test_hair_hides_what_cycles_draws_over(folder: Path) -> None:
    hair = json.loads((folder / "hair.json").read_text())
    assert hair.pop("hidden") == {"drawn": 0.0, "tubes": 0.0}
    assert {*hair} == {"own", "children", "curves"}
    for kind, seen in hair.items():
        for when in ("", "turned "):
            assert seen[f"{when}alike"] > 0.95, (kind, seen)
            assert seen[f"{when}drawn"] > 200, (kind, seen)
            assert 0.9 < seen[f"{when}tubes"] / seen[f"{when}drawn"] < 1.2, (kind, seen)


@pytest.mark.slow
def test_cameras_are_blender_s_own(folder: Path) -> None:
    cases = json.loads((folder / "cameras.json").read_text())
    assert len(cases) == 27
    for case in cases:
        width, height, aspect = case["width"], case["height"], case["aspect"]
        ours = SceneCamera(70.0, 30.0, 20.0, case["fit"], 0.1, -0.07, aspect, width, height)
        camera = ours.at(max(width, height))
        assert (camera.width, camera.height) == (width, height)
        points = np.random.default_rng(1).uniform((-300, -300, 900), (300, 300, 1500), (20, 3))
        clip = np.c_[points * (1, -1, -1), np.ones(20)] @ np.array(case["matrix"]).T
        seen = clip[:, :2] / clip[:, 3:]
        expected = (seen * (1, -1) + 1) / 2 * (width, height)
        assert np.abs(camera.project(points) - expected).max() < 1e-3, case
        assert np.allclose(camera.matrix, SceneCamera.of_numbers(ours.numbers).at(max(width, height)).matrix)
        back = camera.rays(camera.project(points))[1] * points[:, 2:]
        assert np.abs(back - points).max() < 1e-6


@pytest.mark.parametrize("data", [b"", b"v 1 2 3\n", b"PK\3\4"])
def test_what_is_no_blend_is_refused_without_blender(
    tmp_path: Path, data: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(blend, "python_command", lambda *_: pytest.fail("nothing is to be started"))
    (tmp_path / "anna.blend").write_bytes(data)
    with pytest.raises(UsageError, match=r"anna\.blend: not a \.blend; save it in Blender again$"):
        find_heads(tmp_path / "anna.blend")


def test_a_head_is_chosen_of_scenes_alone(tmp_path: Path) -> None:
    (tmp_path / "anna.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(UsageError, match="is no Blender scene, so there is nothing to choose"):
        find_heads(tmp_path / "anna.obj", head_object="Head")
