# SPDX-License-Identifier: GPL-3.0-or-later
"""scene.headturn: the settings of the build, made from their table, and what is shown of them."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    IntVectorProperty,
    PointerProperty,
    StringProperty,
)

from . import edits, gallery
from .core.field import Field
from .core.fields import fields
from .core.units import angle_of, angle_options, degrees, radians
from .core.words import LIMITS
from .registration import WORDS
from .session import Shown, quiet

_FOLLOWS: dict[str, edits.Update] = {
    "heads": edits.source,
    "poses": edits.plan,
    "poses.frame": edits.choice,
    "render": edits.look,
    "landmarks": edits.detection,
}
"""What follows when a setting is edited, by section, or by setting where it is something else."""


ANGLES = "yaw", "pitch", "roll"
"""Of the pose in view."""


def _angle(name: str, description: str) -> Any:
    limit = LIMITS[f"poses.{name.lower()}"]
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
        "listed": StringProperty(),  # JSON of the heads of a source; see keys.listing
        "placed": StringProperty(),  # JSON of the head in view; see keys.placed
        "came_from": PointerProperty(type=bpy.types.Scene),  # of the studio: the user's own
        "frames": IntVectorProperty(size=3),  # start, end, current before the timeline
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
        "yaw": _angle("Yaw", "Turn: above zero the nose goes to image left. Degrees"),
        "pitch": _angle("Pitch", "Nod: above zero the nose goes up. Degrees"),
        "roll": _angle("Roll", "Tilt: above zero the crown goes to image right. Degrees"),
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
        "show_rings": BoolProperty(
            name="Rings",
            description="Draw three rings about the head that turn it: red is pitch, green yaw, blue roll",
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


def _angles(made: dict[str, Any]) -> dict[str, Any]:
    """Beside each property that is an angle, the one in radians that shows it."""
    names = [*ANGLES, *(field.name for field in fields() if field.is_angle)]
    return {angle_of(name): _in_radians(name, made[name]) for name in names}


def _in_radians(name: str, made: Any) -> Any:
    def get(shown: Shown) -> Any:
        return radians(_numbers(getattr(shown, name)))

    def set(shown: Shown, value: Any) -> None:
        with quiet():
            setattr(shown, name, degrees(_numbers(value), _numbers(getattr(shown, name))))

    options = angle_options(made.keywords)
    return made.function(get=get, set=set, update=made.keywords["update"], **options)


def _numbers(value: Any) -> Any:
    return value if isinstance(value, float) else tuple(value)


_registered: list[type] = []


def register() -> None:
    """Add scene.headturn. Angles in degrees, lengths in millimetres, colours sRGB."""
    every = {**_shown(), **_settings()}
    every |= _angles(every)
    said = {name: one.function(**one.keywords, translation_context=WORDS) for name, one in every.items()}
    properties = {"__annotations__": said, "__module__": __name__}
    made = type("HeadturnSettings", (bpy.types.PropertyGroup,), properties)
    bpy.utils.register_class(made)
    _registered.append(made)
    bpy.types.Scene.headturn = PointerProperty(type=made)


def unregister() -> None:
    """Take scene.headturn away."""
    del bpy.types.Scene.headturn
    while _registered:
        bpy.utils.unregister_class(_registered.pop())
