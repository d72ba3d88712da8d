# SPDX-License-Identifier: GPL-3.0-or-later
"""scene.headturn: the settings of the build, made from their table, and what is shown of them."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from . import edits, gallery
from .core.field import Field
from .core.fields import fields

_FOLLOWS: dict[str, edits.Update] = {
    "heads": edits.source,
    "poses": edits.plan,
    "poses.frame": edits.choice,
    "render": edits.look,
    "landmarks": edits.detection,
}
"""What follows when a setting is edited, by section, or by setting where it is something else."""


def _angle(name: str, description: str, limit: float) -> Any:
    return FloatProperty(
        name=name,
        description=description,
        min=-limit,
        max=limit,
        soft_min=-60,
        soft_max=60,
        step=100,
        precision=1,
        update=edits.pose,
    )


def _shown() -> dict[str, Any]:
    """What is no setting of the build: which head, at which pose, how it is shown, where the build goes."""
    return {
        "head": PointerProperty(type=bpy.types.Object),
        "package": StringProperty(),
        "radius": StringProperty(),  # mm as text: Blender's numbers have 32 bits, and the distance follows
        "subject": StringProperty(
            name="Subject",
            description="Which head is shown",
            search=edits.subjects,
            update=edits.choice,
        ),
        "expression": StringProperty(
            name="Expression",
            description="Which expression of this subject is shown",
            search=edits.expressions,
            update=edits.choice,
        ),
        "gallery": EnumProperty(
            name="Head",
            description="All heads of the source, up to 50 before and after this one",
            items=gallery.items,
            get=gallery.chosen,
            set=edits.choose_head,
        ),
        "yaw": _angle("Yaw", "Turn: above zero the nose goes to image left. Degrees", 89.9),
        "pitch": _angle("Pitch", "Nod: above zero the nose goes up. Degrees", 180),
        "roll": _angle("Roll", "Tilt: above zero the crown goes to image right. Degrees", 180),
        "snap": BoolProperty(
            name="Snap to Grid", description="Sliders stop at the poses of the grid only", update=edits.pose
        ),
        "on_timeline": BoolProperty(
            name="Poses on the Timeline",
            description="Frame k shows pose k of the plan: scrub or play to see the dataset",
            update=edits.plan,
        ),
        "show_axes": BoolProperty(
            name="Axes",
            description="Draw the head's frame: red to its left, green up, blue to the front",
            default=True,
            update=edits.overlay,
        ),
        "show_landmarks": BoolProperty(
            name="Landmarks",
            description="Have the host render this pose and draw the 468 points that it finds",
            update=edits.pose,
        ),
        "viewport": EnumProperty(
            name="Viewport",
            items=(
                ("SOLID", "Quick", "Texture without light: follows every slider at once"),
                ("RENDERED", "As Rendered", "Cycles with the light of the build: what the images will show"),
            ),
            update=edits.view,
        ),
        "look_seed": IntProperty(
            name="Seed",
            description="The same seed is the same look, of a build with this seed too. Type one to see it",
            min=0,
            update=edits.look_seed,
        ),
        "draws": StringProperty(
            name="Draws",
            description="Distributions of numbers, instead of those above: lens_mm=uniform:28,135 "
            "ambient=head:normal:0.4,0.1",
        ),
        "out": StringProperty(
            name="Dataset",
            description="Folder of the dataset: new, empty, or one that an interrupted build left",
            subtype="DIR_PATH",
        ),
        "workers": IntProperty(
            name="Workers", description="Heads rendered side by side; 0 takes one a core", min=0
        ),
        "carried": StringProperty(),  # JSON of the loaded configuration, with settings that no panel shows
    }


def _settings() -> dict[str, Any]:
    """Properties of every setting that has a label."""
    return {
        name: getattr(bpy.props, made.kind)(**made.options, **_update(field))
        for field in fields()
        for name, made in field.properties().items()
    }


def _update(field: Field) -> dict[str, Any]:
    found = _FOLLOWS.get(field.setting.name, _FOLLOWS.get(field.setting.section))
    return {} if found is None else {"update": found}


_registered: list[type] = []


def register() -> None:
    """Add scene.headturn. Angles in degrees, lengths in millimetres, colours sRGB."""
    properties = {"__annotations__": {**_shown(), **_settings()}, "__module__": __name__}
    made = type("HeadturnSettings", (bpy.types.PropertyGroup,), properties)
    bpy.utils.register_class(made)
    _registered.append(made)
    bpy.types.Scene.headturn = PointerProperty(type=made)


def unregister() -> None:
    """Take scene.headturn away."""
    del bpy.types.Scene.headturn
    while _registered:
        bpy.utils.unregister_class(_registered.pop())
