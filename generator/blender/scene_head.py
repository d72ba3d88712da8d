# SPDX-License-Identifier: GPL-3.0-or-later
"""The head of a user's own scene: frozen as it is rendered, and turned about its pivot."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import bpy
import numpy as np
from mathutils import Matrix, Vector

from generator.blender.scene_file import SURFACES, find_head, objects_of, open_scene
from generator.blender.scene_mesh import placed_surfaces
from generator.blender.scene_strands import rest_dynamics, show_rendered_strands
from generator.errors import HeadError
from generator.escape import quoted

_KEPT = (
    *("hide_render", "pass_index", "color", "is_holdout", "is_shadow_catcher"),
    *("visible_camera", "visible_diffuse", "visible_glossy", "visible_transmission"),
    *("visible_volume_scatter", "visible_shadow"),
)
"""Of an object that becomes a mesh."""

TURNED = 1e-5
"""How far a vertex may be from where the head's turn takes it, of its distance from the world's origin."""


class SceneHead:
    """Opens a .blend, and has everything that belongs to its head hang on a pivot of ours.

    Surfaces are frozen as they are rendered: subdivided, posed, with their shape keys. So nothing that moves
    them may do so again when the head turns, and what is labelled is what is seen. The file is only read.

    head_object, shape_key: of :class:`generator.heads.head.Head`.
    Raises HeadError: it cannot be opened, or what is named is not there.
    """

    def __init__(self, file: Path, head_object: str, shape_key: str = "") -> None:
        open_scene(file)
        self.problems: list[str] = []
        self.scene = bpy.context.scene
        engine = self.scene.render.engine
        if engine != "CYCLES":
            self.problems.append(
                f"the scene is set to {engine}, which needs a graphics card; it is rendered with Cycles"
            )
        _show_what_is_rendered(self.scene)
        self.problems += rest_dynamics()
        thing = find_head(head_object)
        self.objects = objects_of(thing)
        if shape_key and not _set_shape_key(self.objects, shape_key):
            raise HeadError(f"no shape key {quoted(shape_key)} in {quoted(thing.name)}")
        bpy.context.view_layer.update()
        self.frame = _frame(self.objects)
        self._pivot = bpy.data.objects.new("Headturn pivot", None)
        self.scene.collection.objects.link(self._pivot)
        self._freeze()
        self.problems += _flatten(self.objects)
        self._checked = False

    def turn(self, rotation: np.ndarray, pivot: np.ndarray) -> None:
        """Turn the head as it stands in the file by a rotation [3, 3] about a point of the world.

        Raises HeadError: something of it does not turn with it.
        """
        centre = Vector(pivot.tolist())
        turn = Matrix(rotation.tolist()).to_4x4()
        self._pivot.matrix_world = Matrix.Translation(centre) @ turn @ Matrix.Translation(-centre)
        if not self._checked and not np.allclose(rotation, np.eye(3)):
            self._check(rotation, pivot)
            self._checked = True

    def instanced(self) -> list[bpy.types.Object]:
        """What else is drawn as part of the head: what its objects are instances of."""
        ours = {*self.objects}
        graph = bpy.context.evaluated_depsgraph_get()
        found = {
            one.object.original
            for one in graph.object_instances
            if one.is_instance and one.parent.original in ours
        }
        return [*found]

    def _freeze(self) -> None:
        graph = bpy.context.evaluated_depsgraph_get()
        instancers = {one.parent.original for one in graph.object_instances if one.is_instance and one.parent}
        frozen = [_frozen(one.evaluated_get(graph), one in instancers, graph) for one in self.objects]
        worlds = [one.evaluated_get(graph).matrix_world.copy() for one in self.objects]
        # What is linked from another file cannot be changed.
        local = [one.make_local() if one.library is not None else one for one in self.objects]
        self.objects = [
            one if data is None else _with_data(self.scene, one, data)
            for one, data in zip(local, frozen, strict=True)
        ]
        placed = dict(zip(self.objects, worlds, strict=True))
        for one, world in placed.items():
            above = one.parent
            if above in placed and above.instance_type in ("VERTS", "FACES"):
                # It draws its children, so they have to stay that.
                _hang(one, placed[above].inverted_safe() @ world, above)
            else:
                _hang(one, world, self._pivot)
        bpy.context.view_layer.update()
        self._surfaces = placed_surfaces({*self.objects})

    def _check(self, rotation: np.ndarray, pivot: np.ndarray) -> None:
        bpy.context.view_layer.update()
        now = placed_surfaces({*self.objects})
        if len(now) != len(self._surfaces):
            raise HeadError("something of the head comes and goes as it turns; apply its modifiers")
        for one, turned in zip(self._surfaces, now, strict=True):
            before, after = one.vertices, turned.vertices
            expected = (before - pivot) @ rotation.T + pivot
            far = 1.0 + np.abs(expected).max(initial=0.0)
            if after.shape != before.shape or np.abs(after - expected).max(initial=0.0) > TURNED * far:
                raise HeadError(
                    f"{quoted(one.owner.name)} does not turn with the head: something else holds it; apply "
                    "its modifiers, or parent what holds it to the head"
                )


def _show_what_is_rendered(scene: bpy.types.Scene) -> None:
    """Have what Python can ask for, which is the viewport's, be what is rendered."""
    for one in bpy.data.objects:
        one.hide_viewport = one.hide_render
        one.show_instancer_for_viewport = one.show_instancer_for_render
        for modifier in one.modifiers:
            modifier.show_viewport = modifier.show_render
            if modifier.type == "SUBSURF":
                modifier.levels = modifier.render_levels
            elif modifier.type == "MULTIRES":
                modifier.levels = min(modifier.render_levels, modifier.total_levels)
    for collection in bpy.data.collections:
        collection.hide_viewport = collection.hide_render
    for ball in bpy.data.metaballs:
        ball.resolution = ball.render_resolution
    for curve in bpy.data.curves:
        for one in (curve, *curve.splines):
            one.resolution_u = curve.render_resolution_u or one.resolution_u
            one.resolution_v = curve.render_resolution_v or one.resolution_v
    show_rendered_strands()
    scene.render.simplify_subdivision = scene.render.simplify_subdivision_render
    scene.render.simplify_child_particles = scene.render.simplify_child_particles_render
    layer = bpy.context.view_layer
    waiting = [layer.layer_collection]
    while waiting:
        here = waiting.pop()
        here.hide_viewport = False
        waiting += here.children
    for one in layer.objects:
        one.hide_set(False)


def _set_shape_key(objects: Sequence[bpy.types.Object], name: str) -> bool:
    """Put the shape keys of a name to their largest value, and leave the others; is there any?"""
    graph = bpy.context.evaluated_depsgraph_get()
    found = False
    for one in objects:
        keys = one.data.shape_keys if one.type == "MESH" else None
        if keys is None or name not in keys.key_blocks:
            continue
        # What an action or a driver gave them they keep, and nothing gives them another.
        values = {block.name: block.value for block in keys.evaluated_get(graph).key_blocks}
        keys.animation_data_clear()
        for block in keys.key_blocks:
            block.value = values[block.name]
        block = keys.key_blocks[name]
        block.value = min(1.0, block.slider_max)
        one.show_only_shape_key = False
        found = True
    return found


def _frame(objects: Sequence[bpy.types.Object]) -> Matrix:
    """The head's own axes and origin in the world: those of its topmost object, or the world's of several.

    Of one that is mirrored y and z are its own, and x is not: faces are alike from left to right.
    """
    inside = {*objects}
    roots = [one for one in objects if one.parent not in inside]
    if len(roots) != 1:
        return Matrix.Identity(4)
    graph = bpy.context.evaluated_depsgraph_get()
    world = roots[0].evaluated_get(graph).matrix_world
    place, turn, _ = world.decompose()
    mirrored = Matrix.Diagonal((1, -1, -1, 1)) if world.is_negative else Matrix.Identity(4)
    return Matrix.Translation(place) @ turn.to_matrix().to_4x4() @ mirrored


def _flatten(objects: Sequence[bpy.types.Object]) -> list[str]:
    """Have materials move no surface, which nobody could label; what is said of it."""
    slots = (slot for one in objects for slot in one.material_slots)
    used = {slot.material for slot in slots if slot.material is not None}
    found = [one for one in used if one.displacement_method != "BUMP" and _is_displaced(one)]
    for material in found:
        material.displacement_method = "BUMP"
    names = ", ".join(sorted(quoted(material.name) for material in found))
    said = "displacement is rendered as bump, so that labels are where the surface is"
    return [f"{names}: {said}"] if found else []


def _is_displaced(material: bpy.types.Material) -> bool:
    output = material.node_tree.get_output_node("CYCLES") if material.node_tree else None
    return output is not None and output.inputs["Displacement"].is_linked


def _frozen(
    there: bpy.types.Object, draws_others: bool, graph: bpy.types.Depsgraph
) -> bpy.types.Mesh | bpy.types.Curves | None:
    """What an evaluated object is, as data of its own; None where it is that already, or is not all of it."""
    # Nodes may make meshes and instances of hair. A metaball draws its surface as if it were another's.
    if there.type != "META" and (draws_others or there.particle_systems):
        return None
    if there.type == "CURVES":
        return there.data.copy()
    if there.type not in SURFACES:
        return None
    return bpy.data.meshes.new_from_object(there, preserve_all_data_layers=True, depsgraph=graph)


def _with_data(scene: bpy.types.Scene, one: bpy.types.Object, data: bpy.types.ID) -> bpy.types.Object:
    """An object with other data and nothing that changes it."""
    if one.type in ("MESH", "CURVES"):
        one.modifiers.clear()
        one.data = data
        return one
    made = bpy.data.objects.new(one.name, data)
    for collection in one.users_collection or (scene.collection,):
        (scene.collection if collection.library is not None else collection).objects.link(made)
    for key in _KEPT:
        setattr(made, key, getattr(one, key))
    one.hide_render = one.hide_viewport = True
    return made


def _hang(one: bpy.types.Object, place: Matrix, above: bpy.types.Object) -> None:
    """Have an object stand at a place before another one, and follow that alone."""
    one.constraints.clear()
    one.animation_data_clear()
    one.parent, one.parent_type = above, "OBJECT"
    one.delta_location, one.delta_scale = (0, 0, 0), (1, 1, 1)
    one.delta_rotation_euler, one.delta_rotation_quaternion = (0, 0, 0), (1, 0, 0, 0)
    one.matrix_basis = Matrix.Identity(4)
    one.matrix_parent_inverse = place
