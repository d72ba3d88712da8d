# SPDX-License-Identifier: GPL-3.0-or-later
"""A small dataset made by the real writer from drawn faces and a synthetic landmark cloud."""

from __future__ import annotations

import io
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from PIL import Image, ImageDraw

from generator.dataset.format.anchors_table import HeadAnchors, write_anchors
from generator.dataset.format.columns import ImageMode, further_column
from generator.dataset.format.heads_table import HeadRow, write_heads
from generator.dataset.format.manifest import (
    Manifest,
    configuration_digest,
    write_manifest,
)
from generator.dataset.format.part import commit_unit
from generator.dataset.format.schema import part_schema
from generator.dataset.format.unit_rows import UnitRows
from generator.dataset.show.card import write_card
from generator.geometry.camera import Camera
from generator.geometry.rotation import rotation_from_angles
from generator.plan.config import recorded_config
from generator.plan.first_settings import common_values
from generator.plan.pose_plans import PosePlans, poses_csv
from generator.plan.poses import PosePlan, grid_plan
from generator.plan.settings import Look
from generator.plan.twins import plan_twins

VERSIONS = {"headturn": "0.0.0", "numpy": np.__version__}
CAMERA = Camera.square(64, lens_mm=85.0, distance_mm=700.0)
SMALL_PLAN = grid_plan((-30, 30, 30), (-20, 20, 20), (0, 10, 10))


def face_points() -> np.ndarray:
    """468 points on the front of an ellipsoid the size of a face, mm in frame C."""
    k = np.arange(468) + 0.5
    height, turn = 1 - 2 * k / 468, np.pi * (1 + 5**0.5) * k
    ring = np.sqrt(1 - height**2)
    return np.stack([70 * ring * np.cos(turn) * 0.9, 90 * height, -75 * np.abs(ring * np.sin(turn))], axis=-1)


def face_anchors() -> np.ndarray:
    """The points of :func:`face_points`; the last one has no anchor."""
    anchors = face_points()
    anchors[-1] = np.nan
    return anchors


def face_visible(rotations: np.ndarray, camera: Camera) -> np.ndarray:
    """Points whose side of the ellipsoid looks to the camera."""
    anchors = face_anchors()
    points = anchors @ np.swapaxes(rotations, -1, -2) + camera.translation_mm
    normals = anchors / np.array([63.0, 90.0, 75.0]) ** 2 @ np.swapaxes(rotations, -1, -2)
    with np.errstate(invalid="ignore"):
        return (normals * points).sum(-1) < 0


def draw_face(rotation: np.ndarray, camera: Camera, tone: tuple[int, int, int]) -> bytes:
    """PNG of eyes, nose and mouth on an oval, at their places in the pose."""
    points = {"eye": (-30, -20, -65), "eye2": (30, -20, -65), "nose": (0, 10, -90), "mouth": (0, 45, -65)}
    image = Image.new("RGB", (camera.width, camera.height), (128, 128, 128))
    draw = ImageDraw.Draw(image)
    outline = camera.project(face_points() * 1.1 @ rotation.T + camera.translation_mm)
    (left, top), (right, bottom) = outline.min(axis=0), outline.max(axis=0)
    draw.ellipse((left, top, right, bottom), fill=tone)
    for name, point in points.items():
        x, y = camera.project(rotation @ np.array(point, float) + camera.translation_mm)
        r = camera.width / 40
        draw.ellipse((x - r, y - r, x + r, y + r), fill=(40, 20, 20) if "eye" in name else (200, 90, 90))
    file = io.BytesIO()
    image.save(file, "PNG")
    return file.getvalue()


TWIN_SHIFT_PX = (3.0, 4.0)
"""How far landmarks are off in a twin."""


def unit_rows(
    head: HeadRow, plan: PosePlan, chosen: slice, camera: Camera = CAMERA, factor: str = ""
) -> UnitRows:
    """One unit: the chosen poses of one head. Large yaw with pitch up is a miss.

    factor: of twins; every large yaw is a miss, and landmarks are off by TWIN_SHIFT_PX.
    """
    angles = plan.angles_deg[chosen]
    rotations = rotation_from_angles(angles)
    detected = ~((angles[:, 0] >= 30) & ((angles[:, 1] >= 20) | bool(factor)))
    landmarks = np.full((len(angles), 468, 3), np.nan, np.float32)
    for row in np.flatnonzero(detected):
        points = face_points() @ rotations[row].T + camera.translation_mm
        scale = camera.focal_px / camera.distance_mm
        depth = (points[:, 2:] - camera.distance_mm) * scale
        shift = TWIN_SHIFT_PX if factor else (0, 0)
        landmarks[row] = np.concatenate([camera.project(points) + shift, depth], axis=1)
    tone = (224, 190, 160) if head.subject < "s2" else (150, 105, 80)
    return UnitRows(
        subject=head.subject,
        expression=head.expression,
        split=head.split,
        head_license=head.license,
        redistributable=head.redistributable,
        angles_deg=angles,
        indices=plan.indices[chosen],
        cameras=(camera,),
        looks=(Look(),),
        detected=detected,
        landmarks=landmarks,
        anchors=face_anchors(),
        visible=face_visible(rotations, camera),
        images=[draw_face(rotation, camera, tone) for rotation in rotations],
        factor=factor,
    )


def shifted(unit: UnitRows, off: tuple[float, float]) -> np.ndarray:
    """Landmarks of every row, so many pixels off: float32 [N, 468, 3]."""
    [camera] = unit.cameras
    points = face_points() @ np.swapaxes(unit.rotation, 1, 2) + camera.translation_mm
    depth = (points[..., 2:] - camera.distance_mm) * camera.focal_px / camera.distance_mm
    return np.concatenate([camera.project(points) + off, depth], axis=-1).astype(np.float32)


def replaced(batch: pa.RecordBatch, name: str, column: pa.Array) -> pa.RecordBatch:
    """With another column of this name."""
    place = batch.schema.get_field_index(name)
    return batch.set_column(place, batch.schema.field(place), column.cast(batch.schema.field(place).type))


def head_row(subject: str, split: str) -> HeadRow:
    return HeadRow(
        subject=subject,
        expression="neutral",
        source="mesh",
        mesh_path=f"{subject}/head.obj",
        file_sha256=((f"{subject}/head.obj", "0" * 64), (f"{subject}/skin.png", "1" * 64)),
        license="CC0-1.0",
        redistributable=True,
        attribution="A. Person | 2020",
        units="cm",
        mm_per_unit=10.0,
        up="+Y",
        forward="+Z",
        pivot=(0.0, 1.5, -2.25),
        radius_mm=120.0,
        distance_mm=CAMERA.distance_mm,
        lens_mm=CAMERA.lens_mm,
        vertices=100,
        triangles=196,
        split=split,
        anchor_views=10,
        anchor_absent=1,
        anchor_residual_px=1.5,
        anchor_residual_mm=1.0,
        anchor_asymmetry_mm=0.5,
        correction_sd_deg=(0.5, 1.0, 0.5),
        problems=("the eyes are closed",) if subject == "s2" else (),
    )


HEADS = (head_row("s1", "train"), head_row("s2", "validation"))


def twin_unit(
    head: HeadRow, plan: PosePlan, camera: Camera, factor: str, configuration: dict
) -> tuple[UnitRows, pa.Schema]:
    """The twins of all rows of a head, with the looks that the configuration plans, and their schema."""
    config = recorded_config(configuration, Path())
    poses = [*map(tuple, plan.angles_deg.tolist())]
    views = plan_twins(config, f"{head.subject}/{head.expression}", head.radius_mm, poses, factor)
    rows = replace(unit_rows(head, plan, slice(None), camera, factor), looks=views.looks)
    digest = configuration_digest(common_values(configuration))
    return rows, part_schema(configuration["dataset"]["images"], VERSIONS, digest, twins=True)


def build_dataset(
    root: Path,
    images: ImageMode = "files",
    heads: tuple[HeadRow, ...] = HEADS,
    plan: PosePlan = SMALL_PLAN,
    chunk: int = 10,
    camera: Camera = CAMERA,
    twins: tuple[str, ...] = (),
    render: dict[str, Any] | None = None,
    also: Mapping[str, tuple[float, float]] | None = None,
) -> Manifest:
    """A finished dataset of heads x plan, a part for every chunk of poses.

    twins: factors of the look. render: further settings of it. also: further detectors, and by how many
    pixels each is off, right and down; they find every face.
    """
    configuration = {
        "poses": {"kind": plan.kind},
        "render": {
            "resolution": camera.width,
            "lens_mm": camera.lens_mm,
            "distance_mm": camera.distance_mm,
            "projection": camera.projection,
            **(render or {}),
        },
        **({"landmarks": {"detector": "mediapipe", "also": [*also]}} if also else {}),
        "dataset": {"images": images, **({"twins": [*twins]} if twins else {})},
    }
    also = also or {}
    schema = part_schema(
        images, VERSIONS, configuration_digest(common_values(configuration)), also=tuple(also)
    )
    root.mkdir(parents=True)
    parts = []
    for number, head in enumerate(heads):
        name = head.subject if re.fullmatch(r"\w+", head.subject, re.ASCII) else f"h{number}"
        for start in range(0, len(plan), chunk):
            unit = unit_rows(head, plan, slice(start, start + chunk), camera)
            unit = replace(
                unit,
                extra={**unit.extra, **{further_column(n): shifted(unit, off) for n, off in also.items()}},
            )
            if render:
                unit = replace(unit, looks=(recorded_config(configuration, root).render.look,))
            parts.append(commit_unit(unit, schema, root, f"{name}-{start}"))
        for factor in twins:
            parts.append(
                commit_unit(*twin_unit(head, plan, camera, factor, configuration), root, name + factor)
            )
    seen_by = {
        "lens_mm": camera.lens_mm,
        "distance_mm": camera.distance_mm,
        "projection": camera.projection,
    }
    heads = tuple(replace(head, **seen_by) for head in heads)
    write_heads(heads, root)
    triangles, weights = np.arange(468), np.full((468, 3), 1 / 3)
    triangles[-1] = -1
    write_anchors(
        [HeadAnchors(h.subject, h.expression, triangles, weights, face_anchors()) for h in heads], root
    )
    (root / "poses.csv").write_text(poses_csv(PosePlans(plan)))
    manifest = Manifest(
        VERSIONS,
        configuration,
        tuple(part for part in parts if not part.of_twins),
        images,
        len(heads),
        created_by="headturn build",
        twins=tuple(part for part in parts if part.of_twins),
    )
    write_card(manifest, root)
    write_manifest(manifest, root)
    return manifest
