# SPDX-License-Identifier: GPL-3.0-or-later
"""One picture of one head at one pose."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from generator.errors import DatasetError, HeadError, UsageError
from generator.execution.build.units import camera_distance
from generator.execution.lanes.renderer import Renderer
from generator.execution.lanes.scratch import scratch_folder
from generator.geometry.rotation import rotation_from_angles
from generator.heads.head import NEUTRAL
from generator.heads.package import save_package
from generator.heads.read import read_mesh
from generator.heads.source import find_heads
from generator.landmarks.mediapipe_mesh import MediaPipeFaceMesh
from generator.placing.face import prepare
from generator.plan.config import BuildConfig
from generator.process import native_silence

DOT = (80, 255, 80)


def render_preview(
    config: BuildConfig,
    pose: tuple[float, float, float],
    picture: Path,
    *,
    expression: str | None = None,
    draw_landmarks: bool = True,
    blender: str | None = None,
) -> str:
    """Render the configured source's one subject at pose (yaw, pitch, roll) into picture.

    Returns a line about what was found. Raises UsageError if the source holds
    several subjects or the suffix is no image format, HeadError if the head
    cannot be built, DatasetError if the picture cannot be written.
    """
    if picture.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise UsageError(f"{picture}: the picture's name must end in .png or .jpg")
    rotation_from_angles(np.array(pose))
    wanted = config.heads
    source = find_heads(
        Path(wanted.source),
        expressions=[expression] if expression else None,
        units=wanted.units,
        up=wanted.up,
        forward=wanted.forward,
    )
    subjects = sorted({head.subject for head in source.heads})
    if not subjects:
        raise HeadError(f"{source.path}: {source.skipped[0].reason}")
    if len(subjects) > 1:
        raise UsageError(
            f"{source.path} holds {len(subjects)} subjects; give the folder of one, or one mesh file"
        )
    head = next((h for h in source.heads if h.expression == NEUTRAL), source.heads[0])
    settings = config.render.settings()
    with scratch_folder() as scratch, native_silence():  # MediaPipe's start-up notes
        renderer = Renderer(scratch, scratch / "render.log", blender=blender)
        detector = MediaPipeFaceMesh(config.landmarks.min_confidence)
        try:
            mesh = read_mesh(head, scratch, import_with_blender=renderer.import_mesh)
            prepared = prepare(head, mesh, renderer, detector, scratch)
            package = scratch / "head.npz"
            save_package(prepared.normalise(mesh), package)
            [frame] = renderer.render(package, settings, camera_distance(config, prepared), [pose])
            image = cv2.imread(str(frame))
            found = detector.detect(cv2.cvtColor(image, cv2.COLOR_BGR2RGB))
        finally:
            renderer.close()
            detector.close()
    if draw_landmarks and found is not None:
        radius = max(1, round(settings.resolution / 300))
        for x, y in found[:, :2]:
            cv2.circle(image, (round(x), round(y)), radius, DOT, -1, cv2.LINE_AA)
    _, encoded = cv2.imencode(picture.suffix, image)
    try:
        picture.write_bytes(encoded.tobytes())
    except OSError as error:
        raise DatasetError(f"{picture}: cannot be written ({error.strerror})") from error
    notes = "; ".join(prepared.notes)
    return ("landmarks found" if found is not None else "no face was found at this pose") + (
        f" ({notes})" if notes else ""
    )
