# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs with a bpy wheel: an extension whose table has settings more. argv: its zip, folder."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import bpy

NAME = "bl_ext.user_default.headturn"
LAYOUTS = ("row", "column", "box", "split", "grid_flow")


class Drawn:
    """A layout that notes which properties are drawn in it."""

    def __init__(self) -> None:
        self.names: list[str] = []

    def prop(self, data: Any, name: str, **how: Any) -> None:
        """As Blender's."""
        assert name in data.bl_rna.properties, name
        self.names.append(name)

    def __getattr__(self, kind: str) -> Any:
        return lambda *_, **__: self if kind in LAYOUTS else SimpleNamespace()


def drawn_by(panel: str) -> list[str]:
    """Properties that a panel draws, from the top."""
    layout = Drawn()
    draw = getattr(importlib.import_module(f"{NAME}.panel"), panel).draw
    draw(
        SimpleNamespace(layout=layout),
        SimpleNamespace(scene=bpy.context.scene, preferences=None, region=None),
    )
    return layout.names


def main(package: str, folder: str) -> None:
    bpy.ops.extensions.package_install_files(filepath=package, repo="user_default", enable_on_install=True)
    settings = importlib.import_module(f"{NAME}.settings")
    for name in ("panel", "build_lines", "waiting", "setting_up"):
        rows = importlib.import_module(f"{NAME}.{name}")
        rows.message = lambda *_, **__: None  # there is no region whose width lines are wrapped to
    shown = bpy.context.scene.headturn

    found = shown.bl_rna.properties["render_exposure"]
    assert (found.type, found.default, found.hard_min, found.hard_max) == ("FLOAT", 0, -5, 5)
    assert (found.name, found.description) == ("Exposure", "Exposure (stops)")
    found = shown.bl_rna.properties["render_tint"]
    items = [(item.identifier, item.name, item.description) for item in found.enum_items]
    assert items[0][0] == found.default == "GUESS", items
    assert items[1:] == [("warm", "Warm", ""), ("cold", "Cold", "Like the moon")], items
    assert found.name == "Colour of the Light"
    assert shown.bl_rna.properties["dataset_logo"].subtype == "FILE_PATH"
    assert shown.bl_rna.properties["poses_jitter"].array_length == 2 and shown.poses_jitter_unset

    names = drawn_by("LookPanel")
    assert "render_background" in names and names[-2:] == ["render_exposure", "render_tint"], names
    names = drawn_by("PosesPanel")
    assert names.index("poses_frame") + 1 == names.index("poses_jitter_unset"), names
    assert {"dataset_notes", "dataset_logo"} < set(drawn_by("OutputPanel"))

    plan = importlib.import_module(f"{NAME}.generator.plan.view_plan")
    planned = settings.planned(shown)
    views = plan.plan_views(planned, "a/neutral", 120.0, [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0)])
    near = plan.framed_camera(planned.render, 120.0).distance_mm
    assert len({view.camera.distance_mm for view in views}) == 2
    assert all(view.camera.distance_mm > 2 * near for view in views)

    settings.save(shown, Path(folder) / "plain.toml")
    shown.render_exposure, shown.render_tint = -1.3, "cold"
    shown.poses_jitter_unset, shown.poses_jitter = False, (0.1, 2)
    shown.dataset_notes, shown.dataset_logo = 'a, "b, c"', "/logo.png"
    settings.save(shown, Path(folder) / "full.toml")
    full = settings.to_config(shown)
    settings.load(shown, Path(folder) / "plain.toml")
    assert (shown.render_exposure, shown.render_tint, shown.poses_jitter_unset) == (0, "GUESS", True)
    settings.load(shown, Path(folder) / "full.toml")
    assert settings.to_config(shown) == full and round(shown.render_exposure, 6) == -1.3
    print("passed", bpy.app.version_string)


main(*sys.argv[1:])
