# SPDX-License-Identifier: GPL-3.0-or-later
"""Find the face of a head: its axes, its units, its centre and its size.

Heads come with shoulders, in any unit and on any origin, so nothing is read off
the mesh's box. The head is rendered from the front, the detector finds the
face, and the landmarks that matter are cast back onto the surface. Where that
shows no face, or one that is turned, the mesh is looked at from all round, and
again from where its face looks to, until that is its front.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import permutations, product

import numpy as np

from generator.errors import HeadError
from generator.geometry.rotation import (
    angles_from_rotation,
    geodesic_deg,
    graphics_rotation,
)
from generator.heads.head import SCENE, Head
from generator.heads.mesh import HeadMesh
from generator.heads.placement import Placement
from generator.heads.surroundings import clusters, surroundings
from generator.heads.units import BLENDER_AXES, CANDIDATE_AXES, axes_rotation, scale_of
from generator.placing.around import Sight, find_around
from generator.placing.looking import MAX_RESIDUAL, Eyes, Face, look

PIVOT_DEPTH = 1.00
"""Depth of the ear axis behind the outer eye corners, in outer-eye distances.

About 90 mm for eyes 90 mm apart; a convention, see docs/heads.md.
"""

REACH = 2.0
"""Vertices farther from the pivot than this many eye distances are not the head."""

STRAIGHT_DEG = (8.0, 15.0, 8.0)
"""A face with less yaw, pitch and roll than this looks along its axes. Heads are shaped differently, and
above all their profile leaves open where their pitch is zero."""

MAYBE_STRAIGHT_DEG = 25.0
"""What is seen from all round as less turned than this is looked at along its axes."""

SETTLED_DEG = 1.0
"""Faces are turned to the camera until they are as near to the front as this."""

TURNS = 6
"""How often that is tried."""

MAX_TURN_DEG = 65.0
"""A face is never farther than this from the nearest axes of its mesh; where others are asked for, they
are wrong."""

NEARLY_DEG = 5.0
"""Axes that are this much nearer are not preferred to likelier ones."""

MOST_GROUPS = 2
"""Of parts that lie apart, these many are looked at."""

_WINDOWS = (1.0, 0.6, 0.36, 0.22)
"""Share of the mesh's height that is looked at, from the crown down: a head, a bust, a body."""

_FACE_WINDOW = 3.4
"""Side of the second, sharp look, in outer-eye distances."""

_FIRST_WINDOW = 4.0
"""Side of the first look at what was seen from all round."""

Axes = tuple[str, str]
"""Up and forward."""


def find_face(head: Head, mesh: HeadMesh, eyes: Eyes) -> Placement:
    """Find the face of one head; see the module's docstring.

    Raises HeadError if no face is found, it does not look along the axes that were asked for, or its
    size does not fit the unit that was.
    """
    try:
        return _find_face(head, mesh, eyes)
    except HeadError as error:
        raise HeadError(f"{head.mesh_path}: {error}") from error


def _find_face(head: Head, mesh: HeadMesh, eyes: Eyes) -> Placement:
    # An object in Blender has Blender's axes, or those of the file that it was imported from.
    first = _axes_of(head)[: 2 if head.source == SCENE else 1]
    groups = clusters(mesh, MOST_GROUPS)
    for part, axes in product((mesh, *groups), first):
        if (placement := _straight(head, mesh, part, axes, eyes)) is not None:
            return placement
    for part in groups or [mesh]:
        for sight in find_around(part, eyes):
            axes = _nearest_axes(head, sight.turn)
            maybe = axes not in first and _apart_deg(axes, sight.turn) <= MAYBE_STRAIGHT_DEG
            if maybe and (placement := _straight(head, mesh, part, axes, eyes)) is not None:
                return placement
            if (settled := _settle(part, sight, eyes)) is not None:
                return _turned(head, mesh, *settled)
    raise HeadError(
        "no face was found from the front or any other side; check the mesh and its texture, and that it "
        "shows the whole face"
    )


def place_face(head: Head, mesh: HeadMesh, face: Face) -> Placement:
    """The placement of a face that is known in the mesh's own axes and units, its turn in them, too.

    Raises HeadError as :func:`find_face` does.
    """
    axes = _nearest_axes(head, face.turn)
    rotation = axes_rotation(*axes)
    in_axes = graphics_rotation(rotation) @ face.turn
    try:
        if (np.abs(angles_from_rotation(in_axes)) > STRAIGHT_DEG).any():
            return _turned(head, mesh, face.seen_from(face.turn), face.turn)
        return _measure(head, mesh, face.rotated(rotation), axes, rotation, ())
    except HeadError as error:
        raise HeadError(f"{head.mesh_path}: {error}") from error


def _straight(head: Head, mesh: HeadMesh, part: HeadMesh, axes: Axes, eyes: Eyes) -> Placement | None:
    """The placement of a face in part of the mesh that looks along some axes, or None."""
    rotation = axes_rotation(*axes)
    face = _along(replace(part, vertices=part.vertices @ rotation.T), eyes)
    if face is None or face.residual > MAX_RESIDUAL:
        return None
    if (np.abs(angles_from_rotation(face.turn)) > STRAIGHT_DEG).any():
        return None
    return _measure(head, mesh, face, axes, rotation, ())


def _turned(head: Head, mesh: HeadMesh, face: Face, turn: np.ndarray) -> Placement:
    """The placement of a face that looks past the mesh's axes. turn: R_C in the mesh's own."""
    axes = _nearest_axes(head, turn)
    in_axes = graphics_rotation(axes_rotation(*axes)) @ turn
    angle = _apart_deg(axes, turn)
    angles = np.round(angles_from_rotation(in_axes), 2) + 0.0
    yaw, pitch, roll = (float(value) for value in angles)
    said = f"yaw {yaw:.0f}, pitch {pitch:.0f}, roll {roll:.0f} degrees"
    if angle > MAX_TURN_DEG:
        raise HeadError(
            f"the face is turned by {angle:.0f} degrees ({said}) from up {axes[0]}, forward {axes[1]}; "
            "correct --up and --forward, or leave them out"
        )
    face_rotation = graphics_rotation(turn.T)
    return _measure(head, mesh, face, axes, face_rotation, (yaw, pitch, roll))


def _measure(
    head: Head,
    mesh: HeadMesh,
    face: Face,
    axes: Axes,
    rotation: np.ndarray,
    turned_deg: tuple[float, ...],
) -> Placement:
    """rotation: R_U from the mesh's own axes to those that the face was found in."""
    up, forward = axes
    width = face.width
    units, scale, notes = scale_of(width, head.units, head.eye_distance_mm)
    if axes != _axes_of(head)[0]:
        notes.append(f"axes guessed: up {up}, forward {forward}")
    if turned_deg:
        yaw, pitch, roll = turned_deg
        notes.append(
            f"the face is turned from up {up}, forward {forward}: yaw {yaw:.0f}, pitch {pitch:.0f}, roll "
            f"{roll:.0f} degrees, which is no pose zero; frame level levels it"
        )
    pivot = face.middle - [0.0, 0.0, PIVOT_DEPTH * width]
    vertices = mesh.vertices @ rotation.T
    reach = np.linalg.norm(vertices - pivot, axis=1)
    is_head = (vertices[:, 1] >= face.chin[1] - 0.1 * width) & (reach <= REACH * width)
    # Rounded to hundredths of a millimetre: far below what a detector can tell,
    # and the same numbers are then printed, stored and used.
    step = 0.01 / scale
    in_source_axes = np.round(np.round(pivot @ rotation / step) * step, 9)
    radius = round(float(reach[is_head].max()) * scale, 2)
    kept = surroundings(mesh, in_source_axes, radius / scale)
    if not kept.all():
        is_kept = np.zeros(len(vertices), dtype=bool)
        is_kept[mesh.triangles[kept]] = True
        radius = round(float(reach[is_head & is_kept].max()) * scale, 2)
        kept = surroundings(mesh, in_source_axes, radius / scale)
        what = "are left out" if mesh.scene is None else "are rendered and bear no landmark"
        notes.append(f"{(~kept).sum()} of {len(kept)} triangles {what}: they lie apart from this face's head")
    return Placement(
        units=units,
        mm_per_unit=scale,
        up=up,
        forward=forward,
        pivot=tuple(in_source_axes.tolist()),
        radius_mm=radius,
        eye_distance_mm=round(width * scale, 2),
        notes=tuple(notes),
        turned_deg=turned_deg or (0.0, 0.0, 0.0),
        scene_camera=mesh.scene.seen_pivot(in_source_axes, scale) if mesh.scene else None,
        no_camera=mesh.scene.why_no_camera(in_source_axes, scale, radius) if mesh.scene else "",
    )


def _axes_of(head: Head) -> list[Axes]:
    """Axes that a head may have, likeliest first: those it says, and what they leave open."""
    if head.up and head.forward:
        return [(head.up, head.forward)]
    signed = [sign + axis for axis in "XYZ" for sign in "+-"]
    others = [(u, f) for u, f in permutations(signed, 2) if u[1] != f[1] and (u, f) not in CANDIDATE_AXES]
    blenders = [BLENDER_AXES] if head.source == SCENE else []
    return [
        (up, forward)
        for up, forward in dict.fromkeys((*blenders, *CANDIDATE_AXES, *others))
        if head.up in (None, up) and head.forward in (None, forward)
    ]


def _nearest_axes(head: Head, turn: np.ndarray) -> Axes:
    """Those of a head's that are nearest to a face, or the likeliest that are nearly as near.

    turn: R_C in the mesh's own axes.
    """
    face, known = graphics_rotation(turn.T), _axes_of(head)
    apart = geodesic_deg(np.stack([axes_rotation(*axes) for axes in known]), face)
    return known[int((apart <= apart.min() + NEARLY_DEG).argmax())]


def _apart_deg(axes: Axes, turn: np.ndarray) -> float:
    return float(geodesic_deg(axes_rotation(*axes), graphics_rotation(turn.T)))


def _settle(mesh: HeadMesh, sight: Sight, eyes: Eyes) -> tuple[Face, np.ndarray] | None:
    """Render, fit, turn, again until the face is frontal: the face, in axes of its own, and its turn.

    None if it never is, or is no face.
    """
    turn, middle, side = sight.turn, sight.middle, _FIRST_WINDOW * sight.width
    for _ in range(TURNS):
        own = graphics_rotation(turn)
        face = look(replace(mesh, vertices=mesh.vertices @ own), middle @ own, side, eyes, closely=True)
        if face is None or not np.isfinite(face.residual):
            return None
        middle, side = own @ face.middle, _FACE_WINDOW * face.width
        turn = turn @ face.turn
        if geodesic_deg(np.eye(3), face.turn) <= SETTLED_DEG:
            return (face.seen_from(face.turn), turn) if face.residual <= MAX_RESIDUAL else None
    return None


def _along(mesh: HeadMesh, eyes: Eyes) -> Face | None:
    for centre, side in _windows(mesh):
        coarse = look(mesh, centre, side, eyes)
        if coarse is None:
            continue
        sharp = look(mesh, coarse.middle, _FACE_WINDOW * coarse.width, eyes, closely=True)
        return sharp if sharp is not None else look(mesh, centre, side, eyes, closely=True)
    return None


def _windows(mesh: HeadMesh) -> Iterator[tuple[np.ndarray, float]]:
    low, high = mesh.vertices.min(0), mesh.vertices.max(0)
    whole = float((high - low)[:2].max())
    for share in _WINDOWS:
        side = 1.1 * share * whole
        middle = (low + high) / 2
        if share < 1.0:
            middle[1] = high[1] - 0.45 * side
        yield middle, side
