# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of scenes whose geometry is known, against the labels' camera and rotation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from generator.dataset.format.passes import (
    PASSES,
    passes_from_blender,
    passes_sha256,
    read_channels,
    write_passes,
)
from generator.errors import WorkerError
from generator.execution.lanes.renderer import Renderer
from generator.geometry.camera import Camera, Projection, framing_distance
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, rotation_from_angles
from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import save_package
from generator.landmarks.surface import Surface
from generator.plan.settings import Look
from generator.plan.views import Views

SIDE = 80.0
POSES = np.array([[0.0, 0, 0], [30, 20, 10], [-50, 40, 30], [25, -35, -20]])


def box() -> HeadMesh:
    """A cube about the pivot, each face with its own texture square; frame U, mm."""
    vertices, triangles, uv = [], [], []
    square = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], float)
    for axis in range(3):
        for sign in (-1.0, 1.0):
            corners = np.zeros((4, 3))
            corners[:, axis] = sign
            corners[:, [(axis + 1) % 3, (axis + 2) % 3]] = square if sign > 0 else square[::-1]
            first = 4 * len(vertices)
            vertices.append(corners * SIDE / 2)
            triangles += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
            uv += [(square[[0, 1, 2]] + 1) / 2, (square[[0, 2, 3]] + 1) / 2]
    return HeadMesh(
        np.concatenate(vertices),
        np.array(triangles, np.int32),
        np.array(uv, np.float32),
        None,
        np.zeros(12, np.int32),
        (Material("skin"),),
    )


def on_the_box(rng: np.random.Generator, count: int) -> np.ndarray:
    """Points on the cube's faces, frame C at pose zero, mm."""
    points = rng.uniform(-0.9, 0.9, (count, 3)) * SIDE / 2
    axis = rng.integers(0, 3, count)
    points[np.arange(count), axis] = rng.choice([-1.0, 1.0], count) * SIDE / 2
    return points @ CAMERA_FROM_GRAPHICS


def views_of(camera: Camera, poses: np.ndarray) -> Views:
    return Views(tuple(map(tuple, poses.tolist())), (camera,), (Look(),))


def shoot(
    renderer: Renderer, folder: Path, camera: Camera, poses: np.ndarray = POSES
) -> list[dict[str, np.ndarray]]:
    """Every pass of the cube at each pose."""
    save_package(box(), folder / "box.npz")
    paths = renderer.render(folder / "box.npz", views_of(camera, poses), passes=PASSES)
    return [passes_from_blender(path, PASSES, camera.distance_mm) for path in paths]


def layer(channels: dict[str, np.ndarray], name: str) -> np.ndarray:
    axes = "UV" if name == "uv" else "XYZ"
    return np.stack([channels[f"{name}.{axis}"] for axis in axes], axis=-1).astype(np.float64)


def where_seen(patch_mm: np.ndarray, corner: np.ndarray, point: np.ndarray, projection: str) -> np.ndarray:
    """The place (x, y) in pixels where a patch of a position pass shows a point.

    From the pass alone, not from K: what a pixel shows, seen from the camera, is an affine
    function of its place, fitted here to the patch. corner: centre of its first pixel.
    """

    def direction(points: np.ndarray) -> np.ndarray:
        return points[..., :2] / points[..., 2:] if projection == "perspective" else points[..., :2]

    rows, columns = patch_mm.shape[:2]
    places = np.stack(np.meshgrid(np.arange(columns), np.arange(rows)), axis=-1).reshape(-1, 2) + corner
    middle = direction(point)
    seen = direction(patch_mm).reshape(-1, 2) - middle
    fitted, *_ = np.linalg.lstsq(np.column_stack([seen, np.ones(len(seen))]), places, rcond=None)
    return fitted[2]


@pytest.mark.parametrize(
    ("lens", "projection"),
    [(20, "perspective"), (85, "perspective"), (135, "perspective"), (50, "orthographic")],
)
def test_points_of_a_cube_are_where_k_says(
    renderer: Renderer, tmp_path: Path, lens: float, projection: Projection
) -> None:
    distance = framing_distance(SIDE * 0.87, lens, 1.05, projection)
    camera = Camera.square(128, lens, round(distance, 2), projection)
    points = on_the_box(np.random.default_rng(3), 60)
    rotations = rotation_from_angles(POSES)
    surface = Surface(box())
    visible = surface.visible(points, views_of(camera, POSES))
    compared = 0
    centres = np.stack(np.meshgrid(np.arange(128) + 0.5, np.arange(128) + 0.5), axis=-1)
    for channels, rotation, seen in zip(shoot(renderer, tmp_path, camera), rotations, visible, strict=True):
        position = layer(channels, "position") * 1e3
        there = channels["object_index.X"] == 1
        assert np.abs(camera.project(position[there]) - centres[there]).max() < 0.01
        np.testing.assert_allclose(channels["depth.Z"][there] * 1e3, position[there, 2], rtol=2e-6)
        normals = layer(channels, "normal")[there] @ rotation
        # Face axes once turned back: one component is 1, the others are 0.
        assert np.abs(np.sort(np.abs(normals), axis=1) - [0, 0, 1]).max() < 1e-3
        posed = points @ rotation.T + camera.translation_mm
        pixels = camera.project(posed)
        for point, pixel, is_seen in zip(posed, pixels, seen, strict=True):
            column, row = (int(v) for v in np.floor(pixel - 0.5))
            patch = position[row - 1 : row + 3, column - 1 : column + 3]
            along = (patch - point) @ layer(channels, "normal")[row, column]
            flat = np.ptp(along) < 1e-2
            if not (there[row - 1 : row + 3, column - 1 : column + 3].all() and flat):
                continue
            assert is_seen == (abs(along[1, 1]) < 0.1), "visible by ray cast, and by the depth pass"
            if is_seen:
                compared += 1
                place = where_seen(patch, np.array([column - 0.5, row - 0.5]), point, projection)
                assert np.abs(place - pixel).max() < 0.01
    assert compared > 40


def test_uv_index_and_nothing(renderer: Renderer, tmp_path: Path) -> None:
    camera = Camera.square(64, 85.0, 400.0)
    [front] = shoot(renderer, tmp_path, camera, POSES[:1])
    geometry = {name: v for name, v in front.items() if not name.startswith(("albedo", "segmentation"))}
    assert set(geometry) == {
        *("depth.Z", "normal.X", "normal.Y", "normal.Z", "position.X", "position.Y", "position.Z"),
        *("uv.U", "uv.V", "object_index.X"),
    }
    there = front["object_index.X"] == 1
    assert 500 < there.sum() < 3000
    for name, values in geometry.items():
        assert values.dtype == np.float32
        if name != "object_index.X":
            assert np.array_equal(np.isnan(values), ~there), name
    position, uv = layer(front, "position")[there] * 1e3, layer(front, "uv")[there]
    # The front face (z = +40 in frame U): u grows with x, v with y, image up.
    np.testing.assert_allclose(uv[:, 0], position[:, 0] / SIDE + 0.5, atol=1e-3)
    np.testing.assert_allclose(uv[:, 1], -position[:, 1] / SIDE + 0.5, atol=1e-3)
    assert np.allclose(position[:, 2], 400 - SIDE / 2, atol=1e-3)


def test_files_are_the_same_bytes_and_read_by_any_reader(renderer: Renderer, tmp_path: Path) -> None:
    camera = Camera.square(32, 85.0, 400.0)
    one, two = (shoot(renderer, tmp_path, camera, POSES[1:2])[0] for _ in range(2))
    assert passes_sha256(one) == passes_sha256(two)
    for name, channels in (("a", one), ("b", two)):
        write_passes(channels, tmp_path / f"{name}.exr")
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    back = read_channels(tmp_path / "a.exr")
    assert all(np.array_equal(back[name], one[name], equal_nan=True) for name in one)
    assert passes_sha256(back) == passes_sha256(one)
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert "C (camera)" in file.header()["headturn.frame"]
    one["depth.Z"][0, 0] = 3.0
    assert passes_sha256(one) != passes_sha256(two)


def test_pictures_and_passes_do_not_disturb_each_other(renderer: Renderer, tmp_path: Path) -> None:
    package, camera = tmp_path / "box.npz", Camera.square(64, 85.0, 400.0)
    views = views_of(camera, POSES[1:2])
    [alone] = shoot(renderer, tmp_path, camera, POSES[1:2])
    save_package(box(), package)  # a new file: the scene is built anew, and a picture comes first

    def picture() -> bytes:
        [path] = renderer.render(package, views)
        return path.read_bytes()

    before = picture()
    for _ in range(2):
        [path] = renderer.render(package, views, passes=PASSES)
        assert passes_sha256(passes_from_blender(path, PASSES, 400.0)) == passes_sha256(alone)
        assert picture() == before


def test_names_of_blender_5(tmp_path: Path) -> None:
    """A part a pass, "Object Index" instead of "IndexOB": what Blender 5.0 writes."""
    value = np.full((2, 3), 0.5, np.float32)
    one = np.array([[1, 1, 1], [1, 1, 0]], np.float32)
    layers = {
        "Combined": {c: value for c in "RGBA"},
        "Depth": {"Z": value},
        "Position": dict(zip("XYZ", (value, 2 * value, 3 * value), strict=True)),
        "Object Index": {"X": one},
    }
    parts = [
        OpenEXR.Part(
            {"type": OpenEXR.scanlineimage, "compression": OpenEXR.NO_COMPRESSION},
            {f"ViewLayer.{name}.{channel}": pixels for channel, pixels in channels.items()},
            f"ViewLayer.{name}",
        )
        for name, channels in layers.items()
    ]
    OpenEXR.File(parts).write(str(tmp_path / "five.exr"))
    made = passes_from_blender(tmp_path / "five.exr", ["depth", "position"], 700.0)
    assert sorted(made) == ["depth.Z", "position.X", "position.Y", "position.Z"]
    np.testing.assert_array_equal(made["depth.Z"], np.where(one == 1, value, np.nan))
    # (x, y, z) of Blender's world is (x, -z, y + distance) of the camera's frame.
    seen = [made[f"position.{axis}"][0, 0] for axis in "XYZ"]
    np.testing.assert_allclose(seen, [0.5, -1.5, 1.7], rtol=1e-6)
    with pytest.raises(WorkerError, match=r"no pass 'normal' among Combined, Depth, Object Index, Position"):
        passes_from_blender(tmp_path / "five.exr", ["normal"], 700.0)
