# SPDX-License-Identifier: GPL-3.0-or-later
"""What really comes out of Blender, measured in pixels."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import OpenEXR
import pytest
from placed_head import PlacedHead

from generator.errors import HeadError
from generator.execution.lanes.renderer import Renderer
from generator.execution.lanes.shots import Shots
from generator.geometry.camera import Camera
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, rotation_from_angles
from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import save_package
from generator.picture.scenery import Folders
from generator.plan.poses import grid_plan
from generator.plan.settings import Look, Render
from generator.plan.view_plan import framed_camera
from generator.plan.views import View, Views

FLAT = Look(ambient=1.0, samples=4)
MARKS = {"nose": ((0, 0, 70), (1, 0, 0)), "crown": ((0, 70, 0), (0, 1, 0)), "left": ((70, 0, 0), (0, 0, 1))}
DISTANCE = 700.0
CAMERA = Camera.square(128, 85.0, DISTANCE)


def sphere(centre: tuple, radius: float) -> tuple[np.ndarray, np.ndarray]:
    """A closed mesh, outward winding."""
    rings, sectors = 16, 24
    polar = np.linspace(0, np.pi, rings + 1)[:, None]
    around = np.linspace(0, 2 * np.pi, sectors, endpoint=False)[None]
    points = np.stack(
        [
            np.sin(polar) * np.cos(around),
            np.cos(polar) * np.ones_like(around),
            -np.sin(polar) * np.sin(around),
        ],
        -1,
    )
    row, column = np.meshgrid(np.arange(rings), np.arange(sectors), indexing="ij")
    right = (column + 1) % sectors
    a, b = row * sectors + column, row * sectors + right
    c, d = (row + 1) * sectors + right, (row + 1) * sectors + column
    faces = np.concatenate([np.stack([a, d, c], -1).reshape(-1, 3), np.stack([a, c, b], -1).reshape(-1, 3)])
    return points.reshape(-1, 3) * radius + np.array(centre), faces


@pytest.fixture(scope="module")
def marked_ball() -> HeadMesh:
    """A grey ball with a red nose, a green crown and a blue left ear (frame U, mm)."""
    parts = [(sphere((0, 0, 0), 55), (0.2, 0.2, 0.2))]
    parts += [(sphere(centre, 9), color) for centre, color in MARKS.values()]
    vertices, triangles, index = [], [], []
    for number, ((v, t), _) in enumerate(parts):
        triangles.append(t + sum(map(len, vertices)))
        vertices.append(v)
        index.append(np.full(len(t), number, np.int32))
    return HeadMesh(
        vertices=np.concatenate(vertices),
        triangles=np.concatenate(triangles).astype(np.int32),
        uv=None,
        vertex_colors=None,
        material_index=np.concatenate(index),
        materials=tuple(Material(str(n), color) for n, (_, color) in enumerate(parts)),
    )


def shoot(
    renderer: Renderer, mesh: HeadMesh, folder: Path, poses: list, look: Look = FLAT, camera: Camera = CAMERA
) -> list[np.ndarray]:
    """RGB images, uint8."""
    package = folder / "head.npz"
    save_package(mesh, package)
    views = Views(tuple(map(tuple, poses)), (camera,), (look,))
    return list(Shots(renderer).take(package, views, Folders()))


def centroid(image: np.ndarray, channel: int) -> np.ndarray | None:
    """Where one colour is seen (x, y), pixels, or None."""
    other = np.delete(image.astype(float), channel, axis=2).max(2)
    weight = np.clip(image[..., channel].astype(float) - other, 0, None)
    if weight.sum() < 255 * 4:
        return None
    y, x = np.mgrid[: image.shape[0], : image.shape[1]] + 0.5
    return np.array([(x * weight).sum(), (y * weight).sum()]) / weight.sum()


def test_signs_seen_in_the_image(renderer: Renderer, marked_ball: HeadMesh, tmp_path: Path) -> None:
    front, yaw, pitch, roll = shoot(
        renderer, marked_ball, tmp_path, [[0, 0, 0], [40, 0, 0], [0, 30, 0], [0, 0, 25]]
    )
    nose, crown, left = (centroid(front, c) for c in range(3))
    assert np.abs(nose - 64).max() < 1, "the nose looks into the camera"
    assert crown[1] < 40, "the crown is above"
    assert left[0] > 88, "the subject's left is image right"
    assert centroid(yaw, 0)[0] < nose[0] - 10, "yaw > 0: nose to image left"
    assert centroid(pitch, 0)[1] < nose[1] - 10, "pitch > 0: nose up"
    assert centroid(roll, 1)[0] > crown[0] + 10, "roll > 0: crown to image right"


def test_every_mark_is_where_the_labels_say(
    renderer: Renderer, marked_ball: HeadMesh, tmp_path: Path
) -> None:
    """Pixel centroids against K (R_C p + t): lens, distance, rotation and frames at once."""
    poses = np.random.default_rng(5).uniform([-50, -40, -30], [50, 40, 30], (6, 3))
    camera = CAMERA
    checked = 0
    for pose, image in zip(poses, shoot(renderer, marked_ball, tmp_path, poses.tolist()), strict=True):
        for channel, (centre, _) in enumerate(MARKS.values()):
            point = rotation_from_angles(pose) @ (CAMERA_FROM_GRAPHICS @ np.array(centre, float))
            seen = centroid(image, channel)
            if point[2] > -15 or seen is None:
                continue  # partly behind the ball
            checked += 1
            assert np.abs(seen - camera.project(point + camera.translation_mm)).max() < 0.35
    assert checked >= 6


def test_light_comes_from_where_it_is_set(renderer: Renderer, marked_ball: HeadMesh, tmp_path: Path) -> None:
    for yaw, pitch, brighter in ((80, 0, "left"), (-80, 0, "right"), (0, 80, "top")):
        for preset in ("fast", "quality"):
            look = replace(FLAT, ambient=0.1, light_yaw_deg=yaw, light_pitch_deg=pitch, preset=preset)
            [image] = shoot(renderer, marked_ball, tmp_path, [[0, 0, 0]], look)
            left, right, top = (
                image[59:69, 40:50].mean(),
                image[59:69, 78:88].mean(),
                image[40:48, 59:69].mean(),
            )
            bright = {"left": left, "right": right, "top": top}
            assert max(bright, key=bright.__getitem__) == brighter, (preset, yaw, pitch)


def test_background_is_the_srgb_value_asked_for(
    renderer: Renderer, marked_ball: HeadMesh, tmp_path: Path
) -> None:
    for preset in ("fast", "quality"):
        look = replace(FLAT, background=(0.2, 0.4, 0.8), preset=preset)
        [image] = shoot(renderer, marked_ball, tmp_path, [[0, 0, 0]], look)
        assert np.abs(image[2, 2].astype(int) - [51, 102, 204]).max() <= 1


def test_texture_vertex_colours_and_holes(renderer: Renderer, tmp_path: Path) -> None:
    """Two squares side by side: one textured (v up, left half cut out), one with vertex colours."""
    pixels = np.zeros((4, 4, 4), np.uint8)
    pixels[:2] = (0, 0, 255, 255)  # BGRA: the upper half is red
    pixels[2:] = (0, 255, 0, 255)  # the lower half is green
    pixels[:, :2, 3] = 0
    cv2.imwrite(str(tmp_path / "t.png"), pixels)
    corners = np.array([[-60, -30, 0], [0, -30, 0], [0, 30, 0], [-60, 30, 0]], float)
    uv = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], np.float32)
    order = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    square = HeadMesh(
        corners,
        order,
        uv[order],
        None,
        np.zeros(2, np.int32),
        (Material("t", (1, 1, 1), tmp_path / "t.png", True),),
    )
    [image] = shoot(renderer, square, tmp_path, [[0, 0, 0]])
    camera = CAMERA

    def at(x: float, y: float) -> np.ndarray:
        column, row = camera.project(np.array([x, -y, DISTANCE]))
        return image[int(row), int(column)].astype(int)

    assert at(-10, 25)[0] > 240 > 20 > at(-10, 25)[1], "upper right of the texture is red"
    assert at(-10, -25)[1] > 240 > 20 > at(-10, -25)[0], "lower right is green"
    assert np.abs(at(-50, 20) - 128).max() <= 1, "the left half is a hole"

    colors = np.tile(np.array([[0.0, 0.0, 1.0]], np.float32), (4, 1))
    colored = replace(square, uv=None, vertex_colors=colors, materials=(Material("c"),))
    [image] = shoot(renderer, colored, tmp_path, [[0, 0, 0]])
    assert at(-30, 0).tolist() == [0, 0, 255]


def test_every_pose_of_the_grid_stays_inside(placed_head: PlacedHead) -> None:
    camera = framed_camera(Render(), placed_head.placement.radius_mm)
    reach = np.linalg.norm(placed_head.mesh.vertices, axis=1)
    head = placed_head.mesh.vertices[reach <= placed_head.placement.radius_mm]
    assert len(head) > 0.7 * len(reach), "the sphere holds the head, not a part of it"
    rotations = rotation_from_angles(grid_plan().angles_deg)
    for rotation in rotations:
        pixels = camera.project(head @ (rotation @ CAMERA_FROM_GRAPHICS).T + camera.translation_mm)
        assert pixels.min() >= 0
        assert pixels.max() <= camera.width


def floats(path: Path) -> np.ndarray:
    with OpenEXR.File(str(path)) as file:
        [channel] = file.channels().values()
        return np.array(channel.pixels)


@pytest.mark.parametrize("preset", ["fast", "quality"])
def test_floats_are_equal_across_processes_and_threads(
    preset: str, placed_head: PlacedHead, tmp_path: Path
) -> None:
    package = tmp_path / "head.npz"
    save_package(placed_head.mesh, package)
    camera, look = Camera.square(64, 85.0, DISTANCE), Look(preset=preset, samples=2)
    poses = [[0, 0, 0], [35, -20, 10], [-50, 40, 30]]
    seen = []
    for threads, order in ((1, poses), (2, poses[::-1])):
        folder = tmp_path / f"threads{threads}"
        folder.mkdir()
        worker = Renderer(folder, tmp_path / "log", threads=threads)
        views = Views(tuple(map(tuple, order)), (camera,), (look,))
        frames = [floats(p) for p in worker.render(package, views, kind="exr")]
        worker.close()
        seen.append(frames if order is poses else frames[::-1])
    for a, b in zip(*seen, strict=True):
        assert a.dtype == (np.float32 if preset == "fast" else np.float16), "that one is laid over a backdrop"
        assert a.std() > 0.05, "there is a picture"
        assert np.array_equal(a, b)


def test_one_sample_of_the_quality_preset_shows_what_many_do(
    renderer: Renderer, placed_head: PlacedHead, tmp_path: Path
) -> None:
    """Also at the edges, before a bright background."""
    look = Look(preset="quality", background=(1.0, 1.0, 0.6))
    few, many = (
        shoot(renderer, placed_head.mesh, tmp_path, [[30, 10, 0]], replace(look, samples=samples))[0]
        for samples in (None, 256)
    )
    assert np.sqrt(np.mean((few.astype(float) - many) ** 2)) < 6.5


def test_the_head_stays_loaded_and_can_be_changed(
    renderer: Renderer, marked_ball: HeadMesh, placed_head: PlacedHead, tmp_path: Path
) -> None:
    ball = shoot(renderer, marked_ball, tmp_path, [[10, 0, 0]])[0]
    head = shoot(renderer, placed_head.mesh, tmp_path, [[10, 0, 0]])[0]
    again = shoot(renderer, marked_ball, tmp_path, [[10, 0, 0]])[0]
    assert np.array_equal(ball, again)
    assert not np.array_equal(ball, head)


def test_a_broken_package_is_an_error_and_the_worker_goes_on(
    renderer: Renderer, marked_ball: HeadMesh, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.npz"
    bad.write_bytes(b"not a package")
    with pytest.raises(HeadError, match="Blender"):
        list(renderer.render(bad, Views.of([View((0, 0, 0), CAMERA, FLAT)])))
    assert shoot(renderer, marked_ball, tmp_path, [[0, 0, 0]])


def test_fbx_is_read_by_blender(renderer: Renderer, placed_head: PlacedHead, tmp_path: Path) -> None:
    """FBX written by a Blender of its own, read back through the worker's converter."""
    import subprocess
    import sys

    from generator.heads.read import read_mesh
    from generator.heads.source import find_heads

    target = tmp_path / "fbx" / "head.fbx"
    target.parent.mkdir()
    script = (
        "import bpy, sys; bpy.ops.wm.read_factory_settings(use_empty=True);"
        "bpy.ops.wm.obj_import(filepath=sys.argv[1]);"
        "bpy.ops.export_scene.fbx(filepath=sys.argv[2], path_mode='COPY', embed_textures=True)"
    )
    source = placed_head.head.mesh_path
    subprocess.run(
        [sys.executable, "-c", script, str(source), str(target)], check=True, capture_output=True, timeout=120
    )
    [head] = find_heads(target.parent).heads
    mesh = read_mesh(head, tmp_path, import_with_blender=renderer.import_mesh)
    original = read_mesh(placed_head.head, tmp_path)
    assert len(mesh.triangles) == len(original.triangles)
    assert any(m.texture for m in mesh.materials)
    shape = np.ptp(original.vertices, axis=0) / np.ptp(mesh.vertices, axis=0)
    assert shape.std() / shape.mean() < 1e-3, "axes and proportions survive"


@pytest.mark.slow
def test_a_killed_worker_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Blender's temporary folder lies in ours, which the next build clears away."""
    elsewhere, ours = tmp_path / "elsewhere", tmp_path / "ours"
    elsewhere.mkdir()
    ours.mkdir()
    monkeypatch.setenv("TMPDIR", str(elsewhere))
    worker = Renderer(ours, ours / "render.log")
    assert list(ours.glob("blender_*"))
    worker.kill()
    assert not list(elsewhere.iterdir())
