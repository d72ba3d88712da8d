# SPDX-License-Identifier: GPL-3.0-or-later
"""One picture of one head at one pose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from generator.errors import DatasetError, HeadError, UsageError
from generator.execution.build.units import head_camera
from generator.execution.lanes.lane import Lane
from generator.execution.lanes.options import LaneOptions
from generator.execution.lanes.scratch import scratch_folder
from generator.geometry.rotation import rotation_from_angles
from generator.heads.head import NEUTRAL, SCENE
from generator.heads.package import save_package
from generator.heads.source import find_heads
from generator.heads.surroundings import head_alone
from generator.landmarks.occlusion import shades, with_occlusion
from generator.picture.scenery import folders_of
from generator.picture.settled import settled
from generator.plan.config import BuildConfig
from generator.plan.scenes import check_of_scenes
from generator.plan.view_plan import drawn_values, plan_views
from generator.process import native_silence

DOT = (80, 255, 80)


@dataclass(frozen=True)
class Preview:
    """What came of it. detected: was a face found? notes: all that is known about the head. drawn: what was
    drawn for the picture, see :func:`generator.plan.view_plan.drawn_values`."""

    detected: bool
    notes: tuple[str, ...]
    drawn: dict[str, Any]

    @property
    def line(self) -> str:
        """Found or not, and what is to be said of the head."""
        found = "landmarks found" if self.detected else "no face was found at this pose"
        return f"{found} ({'; '.join(self.notes)})" if self.notes else found


def render_preview(
    config: BuildConfig,
    pose: tuple[float, float, float],
    picture: Path,
    *,
    expression: str | None = None,
    draw_landmarks: bool = True,
    blender: str | None = None,
) -> Preview:
    """Render the configured source's one subject at pose (yaw, pitch, roll) into picture.

    Raises UsageError if the source holds several subjects or the suffix is no image format, HeadError if
    the head cannot be built, DatasetError if the picture cannot be written.
    """
    if picture.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise UsageError(f"{picture}: the picture's name must end in .png or .jpg")
    rotation_from_angles(np.array(pose))
    config = settled(config)
    wanted = config.heads
    source = find_heads(
        config.located(wanted.source),
        expressions=[expression] if expression else None,
        units=wanted.units,
        up=wanted.up,
        forward=wanted.forward,
        eye_distance_mm=wanted.eye_distance_mm,
        without=wanted.without,
        head_object=wanted.head_object,
    )
    check_of_scenes(config, any(head.source == SCENE for head in source.heads))
    subjects = sorted({head.subject for head in source.heads})
    if not subjects:
        raise HeadError(f"{source.path}: {source.skipped[0].reason}")
    if len(subjects) > 1:
        raise UsageError(
            f"{source.path} holds {len(subjects)} subjects; give the folder of one, or one mesh file"
        )
    head = next((h for h in source.heads if h.expression == NEUTRAL), source.heads[0])
    with scratch_folder() as scratch, native_silence():  # MediaPipe's start-up notes
        lane = Lane(LaneOptions(scratch=str(scratch), blender=blender))
        try:
            mesh = lane.read(head)
            placement = lane.placer(config.detecting).face(head, mesh)
            package = scratch / "preview.npz"
            head_camera(config, placement)
            views = plan_views(config, head.name, placement.radius_mm, [pose], placement.scene_camera)
            placed = placement.normalise(head_alone(mesh, placement))
            if shades(views):
                placed = with_occlusion(placed)
            save_package(placed, package)
            folders = folders_of(config)
            outfits = lane.dressed(head, mesh, placement, views, config.detecting, folders.things)
            [image] = lane.shots.take(package, views, folders, outfits.worn)
            found = lane.detector(config.detecting).detect(image)
        finally:
            lane.close()
    if draw_landmarks and found is not None:
        image = draw_points(image, found)
    _, encoded = cv2.imencode(picture.suffix, cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    try:
        picture.write_bytes(encoded.tobytes())
    except OSError as error:
        raise DatasetError(f"{picture}: cannot be written ({error.strerror})") from error
    left_out = (f"skipped {skip.subject}/{skip.expression}: {skip.reason}" for skip in source.skipped)
    notes = filter(None, (*head.problems, *mesh.problems, *placement.notes, *outfits.left_out, *left_out))
    return Preview(found is not None, tuple(dict.fromkeys(notes)), drawn_values(config, head.name, pose))


def draw_points(image: np.ndarray, points: np.ndarray) -> np.ndarray:
    """A copy of an image with a dot on each point. points: float [N, 2 or more], pixels."""
    drawn = image.copy()
    for x, y in points[:, :2]:
        cv2.circle(drawn, (round(x), round(y)), max(1, round(len(image) / 300)), DOT, -1, cv2.LINE_AA)
    return drawn
