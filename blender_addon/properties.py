# SPDX-License-Identifier: GPL-3.0-or-later
"""The settings of a scene: the build configuration, the pose that is shown, and how it is shown."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import edits, gallery


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


def _axis(name: str, description: str) -> Any:
    axes = [sign + letter for letter in "XYZ" for sign in "+-"]
    return EnumProperty(
        name=name,
        description=description,
        items=[("GUESS", "Guess", "Found from the face"), *((axis, axis, "") for axis in axes)],
        update=edits.source,
    )


def _range(name: str, reach: float, limit: float) -> Any:
    return FloatVectorProperty(
        name=name,
        description=f"{name}: from, to and step in degrees. Random plans use from and to",
        size=3,
        default=(-reach, reach, 10),
        min=-limit,
        max=limit,
        precision=1,
        step=100,
        update=edits.plan,
    )


class HeadturnSettings(bpy.types.PropertyGroup):
    """scene.headturn. Angles in degrees, lengths in millimetres, colours sRGB."""

    # What is shown.
    head: PointerProperty(type=bpy.types.Object)  # type: ignore[valid-type]
    package: StringProperty()  # type: ignore[valid-type]
    radius_mm: FloatProperty()  # type: ignore[valid-type]
    subject: StringProperty(  # type: ignore[valid-type]
        name="Subject",
        description="Which head is shown",
        search=edits.subjects,
        update=edits.choice,
    )
    expression: StringProperty(  # type: ignore[valid-type]
        name="Expression",
        description="Which expression of this subject is shown",
        search=edits.expressions,
        update=edits.choice,
    )
    gallery: EnumProperty(  # type: ignore[valid-type]
        name="Head",
        description="All heads of the source, up to 50 before and after this one",
        items=gallery.items,
        get=gallery.chosen,
        set=gallery.choose,
    )
    yaw: _angle("Yaw", "Turn: above zero the nose goes to image left. Degrees", 89.9)  # type: ignore[valid-type]
    pitch: _angle("Pitch", "Nod: above zero the nose goes up. Degrees", 180)  # type: ignore[valid-type]
    roll: _angle("Roll", "Tilt: above zero the crown goes to image right. Degrees", 180)  # type: ignore[valid-type]
    snap: BoolProperty(  # type: ignore[valid-type]
        name="Snap to Grid", description="Sliders stop at the poses of the grid only", update=edits.pose
    )
    on_timeline: BoolProperty(  # type: ignore[valid-type]
        name="Poses on the Timeline",
        description="Frame k shows pose k of the plan: scrub or play to see the dataset",
        update=edits.plan,
    )
    show_axes: BoolProperty(  # type: ignore[valid-type]
        name="Axes",
        description="Draw the head's frame: red to its left, green up, blue to the front",
        default=True,
        update=edits.overlay,
    )
    show_landmarks: BoolProperty(  # type: ignore[valid-type]
        name="Landmarks",
        description="Have the host render this pose and draw the 468 points that it finds",
        update=edits.pose,
    )
    viewport: EnumProperty(  # type: ignore[valid-type]
        name="Viewport",
        items=(
            ("SOLID", "Quick", "Texture without light: follows every slider at once"),
            ("RENDERED", "As Rendered", "Cycles with the light of the build: what the images will show"),
        ),
        update=edits.view,
    )

    # [heads]
    source: EnumProperty(  # type: ignore[valid-type]
        name="Heads",
        items=(
            ("PARAMETRIC", "Parametric", "Heads made on the spot from MakeHuman's CC0 data"),
            ("FOLDER", "Folder", "A FaceScape download, a folder of meshes, or folders of subjects"),
        ),
        update=edits.source,
    )
    folder: StringProperty(  # type: ignore[valid-type]
        name="Folder",
        description="A FaceScape download, a folder of OBJ, PLY, GLB or FBX, or folders of subjects",
        subtype="DIR_PATH",
        update=edits.source,
    )
    count: IntProperty(  # type: ignore[valid-type]
        name="Heads", description="Parametric heads to make", default=3, min=1, update=edits.source
    )
    seed: IntProperty(  # type: ignore[valid-type]
        name="Seed", description="The same seed makes the same heads", min=0, update=edits.source
    )
    sampled_expressions: IntProperty(  # type: ignore[valid-type]
        name="Expressions",
        description="Sampled expressions a parametric head, besides the neutral face",
        min=0,
        update=edits.source,
    )
    only_subjects: StringProperty(  # type: ignore[valid-type]
        name="Subjects",
        description="Only these, separated by commas. Empty: all of them",
        update=edits.source,
    )
    only_expressions: StringProperty(  # type: ignore[valid-type]
        name="Expressions",
        description="Only these, separated by commas, such as neutral, smile. Empty: all of them",
        update=edits.source,
    )
    units: EnumProperty(  # type: ignore[valid-type]
        name="Units",
        description="Units of the meshes. FaceScape's are known",
        items=(
            ("GUESS", "Guess", "Found from the size of the face"),
            ("um", "Micrometres", ""),
            ("mm", "Millimetres", ""),
            ("cm", "Centimetres", ""),
            ("dm", "Decimetres", ""),
            ("m", "Metres", ""),
        ),
        update=edits.source,
    )
    up: _axis("Up", "Which way the meshes' crown points")  # type: ignore[valid-type]
    forward: _axis("Forward", "Which way the meshes' nose points")  # type: ignore[valid-type]

    # [poses]
    plan: EnumProperty(  # type: ignore[valid-type]
        name="Poses",
        items=(
            ("grid", "Grid", "Every combination of yaw, pitch and roll"),
            ("uniform", "Uniform", "Random poses, independent of each other"),
            ("sobol", "Sobol", "Random poses, evenly spread"),
            ("csv", "CSV File", "The poses of a table"),
        ),
        update=edits.plan,
    )
    frame: EnumProperty(  # type: ignore[valid-type]
        name="Pose Zero",
        items=(
            ("source", "As Modelled", "Pose zero is the mesh's own axes"),
            ("canonical", "Levelled", "Every head is levelled to the same face first"),
        ),
        update=edits.choice,
    )
    yaw_range: _range("Yaw", 50, 89.9)  # type: ignore[valid-type]
    pitch_range: _range("Pitch", 40, 180)  # type: ignore[valid-type]
    roll_range: _range("Roll", 30, 180)  # type: ignore[valid-type]
    pose_count: IntProperty(  # type: ignore[valid-type]
        name="Count", description="Random poses a head", default=693, min=1, update=edits.plan
    )
    pose_seed: IntProperty(name="Seed", description="Of random poses", min=0, update=edits.plan)  # type: ignore[valid-type]
    csv_path: StringProperty(  # type: ignore[valid-type]
        name="File",
        description="Columns yaw_deg, pitch_deg, roll_deg",
        subtype="FILE_PATH",
        update=edits.plan,
    )

    # [render]
    preset: EnumProperty(  # type: ignore[valid-type]
        name="Look",
        items=(
            ("fast", "Fast", "Light computed from the normal: no noise, quick"),
            ("quality", "Quality", "Path traced, soft shadows"),
        ),
        update=edits.look,
    )
    resolution: IntProperty(  # type: ignore[valid-type]
        name="Resolution",
        description="Side of the square images in pixels",
        default=256,
        min=16,
        max=4096,
        update=edits.look,
    )
    lens_mm: FloatProperty(  # type: ignore[valid-type]
        name="Lens",
        description="Focal length in mm on a 36 mm sensor",
        default=85,
        min=10,
        max=1000,
        precision=1,
        step=100,
        update=edits.look,
    )
    projection: EnumProperty(  # type: ignore[valid-type]
        name="Projection",
        items=(
            ("perspective", "Perspective", "A real camera"),
            ("orthographic", "Orthographic", "Parallel rays, the scale of the lens at the pivot"),
        ),
        update=edits.look,
    )
    frame_head: BoolProperty(  # type: ignore[valid-type]
        name="Frame Each Head",
        description="The camera stands where the head just fits at every pose",
        default=True,
        update=edits.look,
    )
    distance_mm: FloatProperty(  # type: ignore[valid-type]
        name="Distance",
        description="Camera to the head's pivot in mm",
        default=700,
        min=100,
        max=100_000,
        precision=1,
        step=1000,
        update=edits.look,
    )
    light_yaw_deg: FloatProperty(  # type: ignore[valid-type]
        name="Light Yaw",
        description="Where the key light stands, seen from the head: above zero towards image left. Degrees",
        default=25,
        min=-180,
        max=180,
        precision=1,
        step=100,
        update=edits.look,
    )
    light_pitch_deg: FloatProperty(  # type: ignore[valid-type]
        name="Light Pitch",
        description="Height of the key light, seen from the head. Degrees",
        default=35,
        min=-90,
        max=90,
        precision=1,
        step=100,
        update=edits.look,
    )
    ambient: FloatProperty(  # type: ignore[valid-type]
        name="Ambient",
        description="Share of the light that comes from everywhere",
        default=0.35,
        min=0,
        max=1,
        subtype="FACTOR",
        update=edits.look,
    )
    background: FloatVectorProperty(  # type: ignore[valid-type]
        name="Background",
        description="Colour behind the head",
        size=3,
        default=(0.5, 0.5, 0.5),
        min=0,
        max=1,
        subtype="COLOR_GAMMA",
        update=edits.look,
    )

    # [dataset] and the build.
    images: EnumProperty(  # type: ignore[valid-type]
        name="Images",
        items=(
            ("files", "Files", "Image files beside the tables"),
            ("embedded", "Embedded", "Images inside the tables"),
            ("none", "None", "Landmarks and poses only"),
        ),
    )
    image_format: EnumProperty(  # type: ignore[valid-type]
        name="Format", items=(("png", "PNG", "Exact"), ("jpg", "JPEG", "Smaller"))
    )
    validation: FloatProperty(  # type: ignore[valid-type]
        name="Validation",
        description="Share of the subjects that go to the validation split",
        min=0,
        max=1,
        subtype="FACTOR",
    )
    out: StringProperty(  # type: ignore[valid-type]
        name="Dataset",
        description="Folder of the dataset: new, empty, or one that an interrupted build left",
        subtype="DIR_PATH",
    )
    workers: IntProperty(  # type: ignore[valid-type]
        name="Workers", description="Heads rendered side by side; 0 takes one a core", min=0
    )
    carried: StringProperty()  # type: ignore[valid-type]  # JSON of loaded settings that no panel shows


def register() -> None:
    """Add scene.headturn."""
    bpy.utils.register_class(HeadturnSettings)
    bpy.types.Scene.headturn = PointerProperty(type=HeadturnSettings)


def unregister() -> None:
    """Take scene.headturn away."""
    del bpy.types.Scene.headturn
    bpy.utils.unregister_class(HeadturnSettings)
