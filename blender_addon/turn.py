# SPDX-License-Identifier: GPL-3.0-or-later
"""Turning the head by hand in the 3D view: R, and three rings about it."""

from __future__ import annotations

from typing import Any, ClassVar

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from . import overlay, own
from .core.units import degrees, radians
from .properties import ANGLES
from .registration import WORDS, registering
from .settings import pose, radius_mm

STEP, SNAP = 1.0, 5.0
"""Degrees that a turn rests at, and with Ctrl where there is no grid."""

KEYS = {"X": "pitch", "Y": "roll", "Z": "yaw"}
"""Axes of Blender's world at pose zero, as for Blender's own R."""

_COLORS = {"pitch": overlay.RED, "yaw": overlay.GREEN, "roll": overlay.BLUE}
_DIGITS = {
    **{name: str(value) for value, name in enumerate(
        ("ZERO", "ONE", "TWO", "THREE", "FOUR", "FIVE", "SIX", "SEVEN", "EIGHT", "NINE")
    )},
    **{f"NUMPAD_{value}": str(value) for value in range(10)},
    **dict.fromkeys(("PERIOD", "NUMPAD_PERIOD", "COMMA"), "."),
    **dict.fromkeys(("MINUS", "NUMPAD_MINUS"), "-"),
}  # fmt: skip


def can_turn(context: bpy.types.Context) -> bool:
    """Is there a head of ours in a scene of ours, and nothing being edited?"""
    scene = context.scene
    return own.is_own(scene) and own.head(scene.headturn) is not None and context.mode == "OBJECT"


class TurnHead(bpy.types.Operator):
    """Turn the head with the mouse: X, Y and Z choose pitch, roll and yaw, digits say degrees, Ctrl keeps to the grid, Shift goes slowly"""  # noqa: E501  one tooltip

    bl_idname = "headturn.turn"
    bl_label = "Turn the Head"
    bl_options: ClassVar[set[str]] = {"REGISTER", "UNDO", "BLOCKING"}

    angle: EnumProperty(  # type: ignore[valid-type]
        name="Angle",
        items=[(name, name.capitalize(), "") for name in ANGLES],
        options={"SKIP_SAVE"},
        translation_context=WORDS,
    )
    by: FloatProperty(  # type: ignore[valid-type]
        name="By", subtype="ANGLE", step=100, options={"SKIP_SAVE"}, translation_context=WORDS
    )
    of_ring: BoolProperty(options={"HIDDEN", "SKIP_SAVE"})  # type: ignore[valid-type]

    _start: tuple[float, float, float]
    _mouse: tuple[int, int]
    _swept: float
    _typed: str

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not can_turn(context):
            cls.poll_message_set("There is no head of Headturn in this scene")
            return False
        return True

    def execute(self, context: bpy.types.Context) -> set[str]:
        self._start = pose(context.scene.headturn)
        self._turn(context, degrees(self.by, 0.0))
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if context.region_data is None:
            self.report({"WARNING"}, "Point at a 3D view first")
            return {"CANCELLED"}
        if context.selected_objects and not self.of_ring:
            return {"PASS_THROUGH"}  # something of the user's: R is Blender's
        from .core import rings

        self._start = pose(context.scene.headturn)
        if not self.properties.is_property_set("angle"):
            self.angle = rings.facing(self._start, _view(context))
        self._begin(event)
        context.window_manager.modal_handler_add(self)
        self._show(context)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if not can_turn(context):  # somebody undid the head away
            return self._end(context, "CANCELLED")
        ends = event.type in ("LEFTMOUSE", "RET", "NUMPAD_ENTER") and event.value == "PRESS"
        if ends or (self.of_ring and (event.type, event.value) == ("LEFTMOUSE", "RELEASE")):
            return self._end(context, "FINISHED")
        if event.type in ("ESC", "RIGHTMOUSE") and event.value == "PRESS":
            self._turn(context, 0.0)
            return self._end(context, "CANCELLED")
        if event.type == "MOUSEMOVE":
            self._follow(context, event)
        elif event.value != "PRESS":
            return {"RUNNING_MODAL"}
        elif event.type in KEYS:
            self._turn(context, 0.0)
            self.angle, self._swept = KEYS[event.type], 0.0
        elif event.type == "BACK_SPACE":
            self._typed = self._typed[:-1]
        elif event.type in _DIGITS:
            self._typed = _with(self._typed, _DIGITS[event.type])
        self._turn(context, self._by(context, event))
        self._show(context)
        return {"RUNNING_MODAL"}

    def _begin(self, event: bpy.types.Event) -> None:
        self._typed, self._swept = "", 0.0
        self._mouse = event.mouse_region_x, event.mouse_region_y

    def _follow(self, context: bpy.types.Context, event: bpy.types.Event) -> None:
        from .core import rings

        middle, radius = _on_screen(context)
        now = event.mouse_region_x, event.mouse_region_y
        axis = _view(context) @ rings.axis(self.angle, self._start)
        by = rings.swept(axis, middle, self._mouse, now, radius)
        self._swept += by * (rings.FINE if event.shift else 1.0)
        self._mouse = now

    def _by(self, context: bpy.types.Context, event: bpy.types.Event) -> float:
        """Degrees, from where the head was."""
        from .core import rings

        if self._typed:
            return _number(self._typed)
        shown, start = context.scene.headturn, self._start[ANGLES.index(self.angle)]
        step = rings.FINE if event.shift else STEP
        if event.ctrl:
            grid = getattr(shown, f"poses_{self.angle}")[2] if shown.poses_kind == "grid" else 0.0
            step = grid if grid > 0 else SNAP
        return rings.rest(self.angle, start, self._swept, step) - start

    def _turn(self, context: bpy.types.Context, by: float) -> None:
        """Turn the head by so many degrees from where it was."""
        from . import studio
        from .core import rings

        to = dict(zip(ANGLES, self._start, strict=True))
        if by:
            to[self.angle] = rings.rest(self.angle, to[self.angle], by, rings.EXACT)
        studio.set_pose(context.scene.headturn, (to["yaw"], to["pitch"], to["roll"]))
        self.by = radians(by)

    def _show(self, context: bpy.types.Context) -> None:
        now = pose(context.scene.headturn)[ANGLES.index(self.angle)]
        typed = f" [{self._typed}|]" if self._typed else ""
        context.area.header_text_set(
            f"{self.angle.capitalize()} {now:g}°, turned by {degrees(self.by, 0.0):g}°{typed}      "
            "X: pitch  Y: roll  Z: yaw  Digits: degrees  Ctrl: grid  Shift: slowly"
        )
        context.area.tag_redraw()

    def _end(self, context: bpy.types.Context, how: str) -> set[str]:
        context.area.header_text_set(None)
        context.area.tag_redraw()
        return {how}


class HeadRings(bpy.types.GizmoGroup):
    """Three rings about the head in view, each of which turns it."""

    bl_idname = "HEADTURN_GGT_rings"
    bl_label = "Turn the Head"
    bl_space_type = "VIEW_3D"
    bl_region_type = "WINDOW"
    bl_options: ClassVar[set[str]] = {"3D", "PERSISTENT"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return can_turn(context) and context.scene.headturn.show_rings

    def setup(self, context: bpy.types.Context) -> None:
        self._rings: dict[str, Any] = {}
        for angle in ANGLES:
            ring = self._rings[angle] = self.gizmos.new("GIZMO_GT_dial_3d")
            ring.draw_options = {"CLIP"}
            ring.use_draw_scale, ring.use_draw_modal = False, True
            ring.color, ring.alpha = _COLORS[angle][:3], 0.6
            ring.color_highlight, ring.alpha_highlight = _COLORS[angle][:3], 1.0
            ring.line_width = overlay.LINE_WIDTH
            button = ring.target_set_operator(TurnHead.bl_idname)
            button.angle, button.of_ring = angle, True

    def draw_prepare(self, context: bpy.types.Context) -> None:
        """Before each drawing: the rings stand where the head's axes are."""
        from mathutils import Matrix, Vector

        from .core import rings

        shown = context.scene.headturn
        size = Matrix.Scale(radius_mm(shown) / 1000, 4)  # Blender's unit is the metre
        place = Matrix.Translation(shown.head.matrix_world.translation)
        for angle, ring in self._rings.items():
            about = Vector(rings.axis(angle, pose(shown)).tolist())
            ring.matrix_basis = place @ about.to_track_quat("Z", "Y").to_matrix().to_4x4() @ size


def _view(context: bpy.types.Context) -> Any:
    """Float64 [3, 3], frame B to the view's."""
    import numpy as np

    return np.array(context.region_data.view_matrix.to_3x3(), dtype=np.float64)


def _on_screen(context: bpy.types.Context) -> tuple[tuple[float, float], float]:
    """The head's pivot, and the radius of the rings about it, in pixels of the region."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    shown, seen = context.scene.headturn, context.region_data
    pivot = shown.head.matrix_world.translation
    side = seen.view_matrix.to_3x3().transposed().col[0] * (radius_mm(shown) / 1000)
    middle, beside = (
        location_3d_to_region_2d(context.region, seen, place) for place in (pivot, pivot + side)
    )
    if middle is None or beside is None:  # behind the viewer
        return (context.region.width / 2, context.region.height / 2), context.region.height / 2
    return tuple(middle), max((beside - middle).length, 1.0)


def _with(typed: str, character: str) -> str:
    """What is typed so far, with one character more: a minus turns the sign round, one point is enough."""
    if character == "-":
        return typed.removeprefix("-") if typed.startswith("-") else f"-{typed}"
    return typed if character == "." and "." in typed else typed + character


def _number(typed: str) -> float:
    digits = typed.strip("-.")
    return float(typed) if digits else 0.0


register, unregister = registering(TurnHead, HeadRings)
