# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawn over the 3D view: the head's frame and the landmarks. Shaders are made when first drawn."""

from __future__ import annotations

from typing import Any

import bpy
from mathutils import Vector

from . import keys, own
from .session import Shown
from .settings import radius_mm

RED, GREEN, BLUE = (0.95, 0.2, 0.25, 1.0), (0.4, 0.8, 0.1, 1.0), (0.2, 0.5, 1.0, 1.0)
DOTS = (0.3, 1.0, 0.3, 1.0)
LINE_WIDTH, DOT_SIZE = 2.5, 3.0
"""Pixels at an interface scale of 1."""

POINTS = "POINT_UNIFORM_COLOR" if bpy.app.version >= (4, 5, 0) else "UNIFORM_COLOR"
"""Shader of points: Vulkan and Metal draw none of a size with one that is not made for them."""

REACH = 1.25
"""Length of the axes in radii of the head."""

_handles: list[tuple[Any, str]] = []


def ensure() -> None:
    """Draw from now on."""
    if _handles or bpy.app.background:
        return
    for draw, when in ((_draw_axes, "POST_VIEW"), (_draw_landmarks, "POST_PIXEL")):
        _handles.append((bpy.types.SpaceView3D.draw_handler_add(draw, (), "WINDOW", when), when))


def remove() -> None:
    """Draw no longer."""
    while _handles:
        handle, _ = _handles.pop()
        bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")


def head_axes(shown: Shown) -> list[Vector]:
    """End points of the head's frame in Blender's world: pivot, left, up, front."""
    reach = REACH * radius_mm(shown) / 1000  # Blender's unit is the metre
    ends = ((0, 0, 0), (reach, 0, 0), (0, 0, reach), (0, -reach, 0))
    return [shown.head.matrix_world @ Vector(end) for end in ends]


def _draw_axes() -> None:
    shown = bpy.context.scene.headturn
    if own.head(shown) is None or not shown.show_axes or not bpy.context.space_data.overlay.show_overlays:
        return
    import gpu
    from gpu_extras.batch import batch_for_shader

    pivot, *ends = head_axes(shown)
    shader = gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")
    region = bpy.context.region
    shader.uniform_float("viewportSize", (region.width, region.height))
    shader.uniform_float("lineWidth", LINE_WIDTH * _scale())
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("ALPHA")
    for end, color in zip(ends, (RED, GREEN, BLUE), strict=True):
        shader.uniform_float("color", color)
        batch_for_shader(shader, "LINES", {"pos": (pivot, end)}).draw(shader)
    gpu.state.blend_set("NONE")


def _draw_landmarks() -> None:
    shown = bpy.context.scene.headturn
    found = keys.landmarks(shown) if shown.show_landmarks else None
    frame = _camera_frame()
    if found is None or found.points is None or frame is None:
        return
    import gpu
    from gpu_extras.batch import batch_for_shader

    left, bottom, width, height = frame
    side = shown.render_resolution
    places = [(left + x / side * width, bottom + (1 - y / side) * height) for x, y in found.points]
    shader = gpu.shader.from_builtin(POINTS)
    shader.uniform_float("color", DOTS)
    gpu.state.point_size_set(DOT_SIZE * _scale())
    batch_for_shader(shader, "POINTS", {"pos": places}).draw(shader)


def _scale() -> float:
    scale: float = bpy.context.preferences.system.ui_scale
    return scale


def _camera_frame() -> tuple[float, float, float, float] | None:
    """(left, bottom, width, height) of the camera's image in the region; None if it is not looked through."""
    from bpy_extras.view3d_utils import location_3d_to_region_2d

    context = bpy.context
    scene, view = context.scene, context.region_data
    if scene.camera is None or view is None or view.view_perspective != "CAMERA":
        return None
    corners = scene.camera.data.view_frame(scene=scene)
    places = [
        location_3d_to_region_2d(context.region, view, scene.camera.matrix_world @ corner)
        for corner in corners
    ]
    if any(place is None for place in places):
        return None
    xs, ys = [p.x for p in places], [p.y for p in places]
    return min(xs), min(ys), max(xs) - min(xs), max(ys) - min(ys)
