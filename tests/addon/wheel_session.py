# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs with a bpy wheel: the installed extension without a window. argv: extension zip, head, folder."""

from __future__ import annotations

import importlib
import sys
from dataclasses import replace
from pathlib import Path

import bpy
import numpy as np

NAME = "bl_ext.user_default.headturn"
R_B = """0.556670399 0.766044443 0.321393805 -0.829598373 0.492403877 0.263258355
0.043412044 -0.413175911 0.909615886"""


def main(package: str, head: str, folder: str) -> None:
    addon_utils = importlib.import_module("addon_utils")  # there once bpy is
    bpy.ops.extensions.package_install_files(filepath=package, repo="user_default", enable_on_install=True)
    for _ in range(2):
        addon_utils.disable(NAME)
        assert not hasattr(bpy.types.Scene, "headturn")
        addon_utils.enable(NAME)
    studio = importlib.import_module(f"{NAME}.studio")
    settings = importlib.import_module(f"{NAME}.settings")
    own = bpy.context.scene
    settings.save(own.headturn, Path(folder) / "saved-defaults.toml")
    for file in sorted(Path(folder).glob("[fm]*.toml")):
        settings.load(own.headturn, file)
        settings.save(own.headturn, file.with_name(f"saved-{file.name}"))
    settings.load(own.headturn, Path(folder) / "saved-defaults.toml")  # what a file leaves out is the default
    before = {name: len(getattr(bpy.data, name)) for name in ("meshes", "materials", "worlds", "cameras")}
    scene = studio.studio_scene(own)
    studio.show_package(scene, Path(head), 120.000000001)
    assert settings.radius_mm(scene.headturn) == 120.000000001
    assert scene != own and scene.headturn.head is not None and own.headturn.head is None

    shown = scene.headturn
    made = shown.head.data.as_pointer(), [m.as_pointer() for m in shown.head.data.materials]
    shown.yaw, shown.pitch, shown.roll = 50, 40, 30
    matrix = np.array(shown.head.matrix_world)[:3, :3]
    assert np.abs(matrix - np.array(R_B.split(), dtype=float).reshape(3, 3)).max() < 1e-6, matrix
    assert made == (shown.head.data.as_pointer(), [m.as_pointer() for m in shown.head.data.materials])

    shown.on_timeline = True
    scene.frame_set(347)
    assert (shown.yaw, shown.pitch, shown.roll, scene.frame_end) == (0, 0, 0, 693)
    shown.yaw = 12.0
    shown.snap = True
    assert shown.yaw == 10.0

    # The camera is the build's; a new look leaves no old data behind.
    for preset in ("quality", "fast", "quality"):
        shown.render_preset = preset
    shown.render_lens_mm, shown.render_resolution = 50, 512
    assert scene.camera.data.lens == 50 and scene.render.resolution_x == 512
    assert round(-1000 * scene.camera.location.y, 2) == round(1.05 * 120 / np.sin(np.arctan(18 / 50)), 2)

    # What the stage can set is set; nothing is built anew. Another number of samples takes another stage.
    made = [thing.as_pointer() for thing in (shown.head, shown.head.data, scene.camera, scene.world)]
    shown.render_ambient, shown.render_margin, shown.render_projection = 0.9, 2.0, "orthographic"
    shown.render_light_yaw_deg, shown.render_background = -40, (0.0, 0.0, 1.0)
    assert made == [thing.as_pointer() for thing in (shown.head, shown.head.data, scene.camera, scene.world)]
    assert scene.camera.data.type == "ORTHO" and scene.cycles.samples == 1
    shown.render_samples_unset, shown.render_samples = False, 9
    assert scene.cycles.samples == scene.cycles.preview_samples == 9
    shown.render_samples_unset = True
    # A stage that lost something is not used.
    bpy.data.worlds.remove(scene.world)
    shown.render_lens_mm, shown.render_margin, shown.render_projection = 50.5, 1.05, "perspective"
    assert scene.world is not None and scene.camera.data.lens == 50.5
    after = {name: len(getattr(bpy.data, name)) for name in before}
    added = {"meshes": 1, "materials": len(shown.head.data.materials), "worlds": 1, "cameras": 1}
    assert after == {name: before[name] + added[name] for name in before}, (before, after)

    # What a build draws for each image is drawn here, too.
    draws = importlib.import_module(f"{NAME}.generator.registries").DRAWS
    draws.add("ambient", lambda view, rng: replace(view, look=replace(view.look, ambient=rng.random())))
    strengths = []
    for yaw in (10, 20, 10):
        shown.yaw = yaw
        strengths.append(scene.world.node_tree.nodes["Background.001"].inputs["Strength"].default_value)
    draws.remove("ambient")
    assert strengths[0] == strengths[2] != strengths[1], strengths

    # A configuration that does not fit changes nothing; Blender would take the last one and cut it off.
    bad = Path(folder) / "bad.toml"
    config = settings.to_config(shown)
    for text in ('resolution = "large"', "resolution = 1e400", "lens_mm = nan", "resolution = 8000"):
        bad.write_text(f"[render]\n{text}\n", encoding="utf-8")
        try:
            settings.load(shown, bad)
        except Exception as error:
            assert "bad.toml" in str(error), error
        else:
            raise AssertionError(f"{text} was taken")
        assert settings.to_config(shown) == config, text
    print("passed", bpy.app.version_string)


main(*sys.argv[1:])
