# SPDX-License-Identifier: GPL-3.0-or-later
"""Light and backdrops in pixels: a ball in panoramas whose light is known."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from panoramas import even, from_the_right, write_exr
from test_render import sphere

from generator.dataset.format.passes import read_channels
from generator.execution.lanes.renderer import Renderer
from generator.execution.lanes.shots import Shots
from generator.geometry.camera import Camera
from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import save_package
from generator.picture.develop import to_linear
from generator.picture.irradiance import LEAST, irradiance
from generator.picture.scenery import Folders, Scenery
from generator.plan.settings import Look
from generator.plan.views import View, Views

CAMERA = Camera.square(96, 85.0, 700.0)
ALBEDO = 0.5
LIT = Look(environment="right")


@pytest.fixture(scope="module")
def package(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A smooth ball of half the image's width that reflects half of the light."""
    vertices, triangles = sphere((0, 0, 0), 75.0)
    display = 1.055 * ALBEDO ** (1 / 2.4) - 0.055
    index = np.zeros(len(triangles), np.int32)
    skin = Material("skin", base_color=(display,) * 3)
    path = tmp_path_factory.mktemp("environment") / "ball.npz"
    save_package(HeadMesh(vertices, triangles.astype(np.int32), None, None, index, (skin,)), path)
    return path


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> Folders:
    """A lamp at the right, even light, and two halves of different colours."""
    folder = tmp_path_factory.mktemp("panoramas")
    write_exr(folder / "right.exr", from_the_right())
    write_exr(folder / "even.exr", even())
    halves = even(0.2)
    halves[:, :32], halves[:, 32:] = [0.6, 0.1, 0.1], [0.1, 0.1, 0.6]
    write_exr(folder / "halves.exr", halves)
    return Folders(str(folder))


@pytest.fixture(scope="module")
def shots(renderer: Renderer) -> Shots:
    return Shots(renderer)


def taken(shots: Shots, package: Path, folders: Folders, *looks: Look, seed: int = 3) -> list[np.ndarray]:
    views = Views.of([View((0.0, 0.0, 0.0), CAMERA, look, seed) for look in looks])
    return list(shots.take(package, views, folders))


def sides(image: np.ndarray) -> tuple[float, float]:
    """Mean light of the ball's left and right half."""
    light = to_linear(image)
    return float(light[40:56, 30:44].mean()), float(light[40:56, 52:66].mean())


@pytest.mark.parametrize("preset", ["fast", "quality"])
def test_a_lamp_at_the_right_lights_the_right_and_turns_with_the_environment(
    shots: Shots, package: Path, folders: Folders, preset: str
) -> None:
    look = replace(LIT, preset=preset, samples=None if preset == "fast" else 64)
    still, half, front = taken(
        shots, package, folders, *(replace(look, environment_yaw_deg=yaw) for yaw in (0.0, 180.0, 90.0))
    )
    left, right = sides(still)
    assert right > 3 * left
    left, right = sides(half)
    assert left > 3 * right
    # A quarter turn to the right has the lamp before the camera: +x to -y.
    left, right = sides(front)
    assert abs(left / right - 1) < 0.15 and front[48, 48].min() > 150


def test_fast_pixels_are_the_form_of_the_normal(shots: Shots, package: Path, folders: Folders) -> None:
    yaw, strength = 60.0, 0.7
    [image] = taken(
        shots, package, folders, replace(LIT, environment_yaw_deg=yaw, environment_strength=strength)
    )
    given = irradiance(from_the_right()).turned(yaw)
    scale = strength / given.facing[0]
    x, y = np.meshgrid(np.arange(34, 63, 4), np.arange(34, 63, 4))
    origins, rays = CAMERA.rays(np.stack([x + 0.5, y + 0.5], axis=-1))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    from_ball = origins - CAMERA.translation_mm
    b = (from_ball * rays).sum(-1)
    hit = from_ball + rays * (-b - np.sqrt(b**2 - (from_ball**2).sum(-1) + 75.0**2))[..., None]
    normal = (hit / 75.0)[..., [0, 2, 1]] * [1, 1, -1]
    expected = np.clip(ALBEDO * scale * given.lit(normal, LEAST * given.facing), 0, 1)
    np.testing.assert_allclose(to_linear(image[y, x]), expected, atol=0.03)


@pytest.mark.parametrize("preset", ["fast", "quality"])
def test_at_strength_one_a_ball_has_its_own_colour_on_average(
    shots: Shots, package: Path, folders: Folders, preset: str
) -> None:
    samples = None if preset == "fast" else 64
    [image] = taken(shots, package, folders, Look(environment="even", preset=preset, samples=samples))
    assert to_linear(image[40:56, 40:56]).mean() == pytest.approx(ALBEDO, rel=0.06)
    key = Look(environment="even", preset=preset, samples=samples, environment_key=0.8)
    [brighter] = taken(shots, package, folders, key)
    assert to_linear(brighter[40:56, 40:56]).mean() > 1.2 * to_linear(image[40:56, 40:56]).mean()


def test_a_backdrop_is_where_the_head_is_not_and_edges_are_mixed(
    shots: Shots, package: Path, folders: Folders
) -> None:
    """Under many samples, edges are the sum of what covers them; with one, a pixel is one or the other."""
    dark = Look(environment="halves", backdrop="environment", environment_strength=0.3)
    many = replace(dark, preset="quality", samples=32)
    for look in (dark, many):
        view = View((0.0, 0.0, 0.0), CAMERA, look, 3)
        [image] = taken(shots, package, folders, look)
        behind = Scenery(folders).behind(view)
        assert behind[10, 10, 0] > 3 * behind[10, 10, 2] and behind[10, 90, 2] > 3 * behind[10, 90, 0]
        light = to_linear(image)
        outside = np.hypot(*(np.indices((96, 96)) - 47.5)) > 28.5
        assert outside.sum() > 3000
        np.testing.assert_allclose(light[outside], np.clip(behind, 0, 1)[outside], atol=6e-3)
    # No halo: no edge is darker or brighter than both of what meets there.
    rim = np.abs(np.hypot(*(np.indices((96, 96)) - 47.5)) - 25.5) < 2.5
    lowest = np.minimum(light[~outside & ~rim].min(axis=0), behind[rim].min(axis=0))
    highest = np.maximum(light[~outside & ~rim].max(axis=0), behind[rim].max(axis=0))
    assert (light[rim] > lowest - 0.05).all() and (light[rim] < highest + 0.1).all()


def test_the_backdrop_decides_nothing_of_the_head(shots: Shots, package: Path, folders: Folders) -> None:
    """The same pixels of the head before any backdrop, and over nothing as over a colour."""
    plain, *others = taken(
        shots, package, folders, *(replace(LIT, backdrop=b) for b in ("plain", "environment", "noise"))
    )
    inside = np.hypot(*(np.indices((96, 96)) - 47.5)) < 22
    for image in others:
        assert np.abs(image[inside].astype(int) - plain[inside]).max() <= 1
    assert np.abs(others[0][:20].astype(int) - others[1][:20]).max() > 5


def test_images_are_the_same_whatever_was_rendered_before(
    shots: Shots, package: Path, folders: Folders
) -> None:
    looks = [
        Look(),
        LIT,
        replace(LIT, backdrop="environment"),
        Look(),
        Look(backdrop="noise"),
        replace(LIT, preset="quality", samples=2),
        Look(preset="quality", samples=2),
        replace(LIT, environment_yaw_deg=70.0, environment_key=0.5),
        Look(light_yaw_deg=-40.0),
        Look(light_yaw_deg=-40.0),
        replace(LIT, preset="quality", samples=2, backdrop="environment"),
    ]
    together = taken(shots, package, folders, *looks)
    backwards = taken(shots, package, folders, *looks[::-1])[::-1]
    for look, one, other in zip(looks, together, backwards, strict=True):
        np.testing.assert_array_equal(one, other)
        [alone] = taken(shots, package, folders, look)
        np.testing.assert_array_equal(alone, one)


def test_a_stage_that_knows_panoramas_shows_looks_without_one_to_the_same_pixels(
    package: Path, folders: Folders, tmp_path: Path
) -> None:
    def of(*looks: Look) -> list[np.ndarray]:
        worker = Renderer(tmp_path, tmp_path / "render.log")
        try:
            return taken(Shots(worker), package, folders, *looks)
        finally:
            worker.close()

    looks = [Look(), Look(light_yaw_deg=-50.0, ambient=0.1), Look(background=(0.1, 0.4, 0.9))]
    for never, after in zip(of(*looks), of(LIT, *looks)[1:], strict=True):
        np.testing.assert_array_equal(never, after)


def test_passes_do_not_change_with_it(
    renderer: Renderer, shots: Shots, package: Path, folders: Folders
) -> None:
    found = []
    for look in (Look(), replace(LIT, backdrop="environment")):
        taken(shots, package, folders, look)
        views = Views.of([View((10.0, 5.0, 0.0), CAMERA, look)])
        [path] = renderer.render(package, views, passes=["depth", "normal"])
        found.append(read_channels(path))
        path.unlink()
    assert set(found[0]) == set(found[1])
    for name, values in found[0].items():
        if "Combined" not in name:
            np.testing.assert_array_equal(values, found[1][name], err_msg=name)
