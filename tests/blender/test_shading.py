# SPDX-License-Identifier: GPL-3.0-or-later
"""How surfaces answer light, in pixels of a ball against the formulas."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from panoramas import even, write_exr
from test_render import sphere

from generator.dataset.format.passes import read_channels
from generator.execution.lanes.renderer import Renderer
from generator.execution.lanes.shots import Shots
from generator.geometry.camera import Camera
from generator.heads.mesh import HeadMesh, Material
from generator.heads.package import save_package
from generator.heads.shine import gloss_of, kind_of_gloss
from generator.picture.develop import to_linear
from generator.picture.scenery import Folders
from generator.plan.settings import Look
from generator.plan.views import View, Views
from generator.plan.wear import Worn

CAMERA = Camera.square(96, 85.0, 700.0)
FACING, LAMP_WIDTH = 0.028, 0.012
"""Of generator.blender.shine, which needs bpy."""

RADIUS = 75.0
ALBEDO = 0.25
X, Y = np.meshgrid(np.arange(34, 63, 4), np.arange(34, 63, 4))
"""Pixels well within the ball."""


def ball(folder: Path, openness: float | None = None, scale: float = 1.0, **more: Any) -> Path:
    """A smooth ball that sends back a quarter of the light, as a package."""
    vertices, triangles = sphere((0, 0, 0), scale * RADIUS)
    display = 1.055 * ALBEDO ** (1 / 2.4) - 0.055
    index = np.zeros(len(triangles), np.int32)
    skin = Material(**{"name": "skin", "base_color": (display,) * 3, **more})
    open_ = None if openness is None else np.full(len(vertices), openness, np.float32)
    mesh = HeadMesh(vertices, triangles.astype(np.int32), None, None, index, (skin,), openness=open_)
    path = folder / f"ball-{openness}-{scale}-{more}.npz"
    save_package(mesh, path)
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("shading")


@pytest.fixture(scope="module")
def shots(renderer: Renderer) -> Shots:
    return Shots(renderer)


def taken(shots: Shots, package: Path, *looks: Look) -> list[np.ndarray]:
    views = Views.of([View((0.0, 0.0, 0.0), CAMERA, look, 3) for look in looks])
    return list(shots.take(package, views, Folders()))


def normals() -> np.ndarray:
    """Of the ball at the pixels, frame B, [..., 3]."""
    origins, rays = CAMERA.rays(np.stack([X + 0.5, Y + 0.5], axis=-1))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    from_ball = origins - CAMERA.translation_mm
    b = (from_ball * rays).sum(-1)
    hit = from_ball + rays * (-b - np.sqrt(b**2 - (from_ball**2).sum(-1) + RADIUS**2))[..., None]
    return (hit / RADIUS)[..., [0, 2, 1]] * [1, 1, -1]


def towards(yaw_deg: float, pitch_deg: float) -> np.ndarray:
    """Unit vector to a lamp, frame B: yaw turns it from the camera to image left, pitch lifts it."""
    yaw, pitch = np.deg2rad([yaw_deg, pitch_deg])
    return np.array([-np.sin(yaw) * np.cos(pitch), -np.cos(yaw) * np.cos(pitch), np.sin(pitch)])


def views_back() -> np.ndarray:
    """Unit vectors from the pixels' points to the camera, frame B, [..., 3]."""
    _, rays = CAMERA.rays(np.stack([X + 0.5, Y + 0.5], axis=-1))
    return -(rays / np.linalg.norm(rays, axis=-1, keepdims=True))[..., [0, 2, 1]] * [1, 1, -1]


def spot(gloss: float, lamp: np.ndarray) -> np.ndarray:
    """What the ball mirrors of a lamp of strength 1, [...]."""
    normal, view = normals(), views_back()
    facing = (normal * view).sum(-1)
    mirrored = 2 * facing[..., None] * normal - view
    sharp = 1 / (2 * (1 - gloss) ** 4 + LAMP_WIDTH)
    fresnel = FACING + (max(gloss**3, FACING) - FACING) * (1 - facing) ** 5
    return fresnel * sharp / 2 * np.exp(sharp * (mirrored @ lamp - 1))


def half_lambert(look: Look) -> np.ndarray:
    """What the key light gives to the pixels, [...]."""
    return (normals() @ towards(look.light_yaw_deg, look.light_pitch_deg) * 0.5 + 0.5) ** 2


@pytest.mark.parametrize("openness", [0.9, 0.4])
def test_ambient_light_comes_by_openness_and_lamps_by_its_square(
    shots: Shots, folder: Path, openness: float
) -> None:
    for occlusion in (1.0, 0.5):
        look = Look(occlusion=occlusion, light_yaw_deg=-40.0)
        [image] = taken(shots, ball(folder, openness), look)
        left = 1 - occlusion * (1 - openness)
        light = look.ambient * left + (1 - look.ambient) * min(1, 2 * left**2) * half_lambert(look)
        np.testing.assert_allclose(
            to_linear(image[Y, X]), np.repeat(ALBEDO * light[..., None], 3, -1), atol=0.012
        )


def test_lamps_are_coloured_cosines(shots: Shots, folder: Path) -> None:
    """Against the formula in the fast preset; about the same in the other."""
    dark = Look(environment="none", ambient=0.0, light_yaw_deg=180.0, light_pitch_deg=0.0)
    lit = replace(dark, lamp1_strength=1.2, lamp1_yaw_deg=70.0, lamp1_pitch_deg=20.0, lamp1_warmth=1.0)
    lit = replace(lit, lamp3_strength=0.7, lamp3_yaw_deg=-30.0, lamp3_pitch_deg=-20.0, lamp3_warmth=-2.0)
    [image] = taken(shots, ball(folder), lit)
    expected = np.repeat(half_lambert(dark)[..., None], 3, -1)
    for lamp in lit.lamps:
        color = lamp.strength * 2 ** (lamp.warmth * np.array([0.5, 0.0, -0.5]))
        expected = (
            expected + np.maximum(normals() @ towards(lamp.yaw_deg, lamp.pitch_deg), 0)[..., None] * color
        )
    np.testing.assert_allclose(to_linear(image[Y, X]), ALBEDO * expected, atol=0.015)
    # Of the path tracer's ball, too, the left is warm and the lower right is cold.
    [traced] = taken(shots, ball(folder), replace(lit, preset="quality", samples=32))
    left, right = (to_linear(traced[40:56, columns]).mean((0, 1)) for columns in (np.s_[26:34], np.s_[58:66]))
    assert left[0] > 1.3 * left[2] and right[2] > 1.5 * right[0]


@pytest.mark.parametrize("gloss", [0.35, 0.7])
def test_a_highlight_is_where_and_what_the_lobe_says(shots: Shots, folder: Path, gloss: float) -> None:
    look = Look(ambient=0.0, light_yaw_deg=35.0, light_pitch_deg=25.0)
    look = replace(look, lamp2_strength=0.5, lamp2_yaw_deg=-60.0, lamp2_pitch_deg=-10.0)
    matt, glossy = taken(shots, ball(folder), look, replace(look, gloss=gloss))
    mirrored = to_linear(glossy) - to_linear(matt)
    key, lamp = towards(35.0, 25.0), towards(-60.0, -10.0)
    expected = spot(gloss, key) + 0.5 * spot(gloss, lamp)
    np.testing.assert_allclose(mirrored[Y, X], np.repeat(expected[..., None], 3, -1), atol=0.02)
    # The brightest place is where the normal is halfway between camera and key light.
    row, column = np.unravel_index(mirrored[..., 1].argmax(), mirrored.shape[:2])
    half = key - np.array([0, 1, 0])
    half *= RADIUS / np.linalg.norm(half)
    at = CAMERA.project((half * [1, 1, -1])[[0, 2, 1]][None] + CAMERA.translation_mm)[0]
    assert np.hypot(column + 0.5 - at[0], row + 0.5 - at[1]) < 3


def test_surroundings_are_mirrored_blurred(shots: Shots, folder: Path, tmp_path: Path) -> None:
    """Even light is mirrored evenly; light from above at the top more than irradiance has it."""
    write_exr(tmp_path / "even.exr", even())
    sky = even(0.0)
    sky[:16] = 1.0
    write_exr(tmp_path / "sky.exr", sky)
    folders, package = Folders(str(tmp_path)), ball(folder)
    for name in ("even", "sky"):
        look = Look(environment=name)
        views = Views.of([View((0.0, 0.0, 0.0), CAMERA, one) for one in (look, replace(look, gloss=0.5))])
        matt, glossy = (to_linear(image) for image in shots.take(package, views, folders))
        middle = (glossy - matt)[46:50, 46:50].mean()
        upper, lower = ((glossy - matt)[rows, 44:52].mean() for rows in (np.s_[34:38], np.s_[58:62]))
        if name == "even":
            assert middle == pytest.approx(0.75 * FACING, abs=0.008) and upper == pytest.approx(
                lower, abs=0.01
            )
        else:
            assert upper > 3 * max(lower, 0.004)


def test_materials_shine_as_what_they_are() -> None:
    def of(name: str, skin: float, **more: Any) -> float:
        return gloss_of(kind_of_gloss(Material(name, **more)), skin)

    assert of("skin", 0.0) == of("eye", 0.0) == 0.0
    assert of("skin", 0.4) == 0.4 and of("Face_mat", 0.4) == 0.4
    assert of("eye", 0.4) == of("Eye_Left", 0.2) == of("cornea", 0.3) == 0.9
    # Labels come with the pass segmentation, and a pass changes no picture.
    assert of("skin", 0.4, label="eyes") == of("skin", 0.4, label="lips") == 0.4
    assert of("eyelash", 0.4) == of("Eyebrows", 0.4) == of("hair", 0.4) == of("x", 0.4, label="clothes") == 0
    assert of("upper_teeth", 0.4) == 0.75
    # What is worn says itself what it is.
    assert of("lens", 0.0, gloss=0.9) == of("lens", 0.4, gloss=0.9) == 0.9


def test_what_has_a_gloss_of_its_own_needs_no_setting(shots: Shots, folder: Path) -> None:
    """And a clear one mirrors as much as one that is not."""
    shines = []
    for opacity in (1.0, 0.25):
        matt, glossy = (
            to_linear(taken(shots, ball(folder, gloss=gloss, opacity=opacity), Look(ambient=0.2))[0])
            for gloss in (0.0, 0.8)
        )
        shines.append((glossy - matt).max())
        assert shines[-1] > 0.15
    assert shines[0] == pytest.approx(shines[1], abs=0.03)
    flat, shiny = (
        taken(shots, ball(folder, gloss=gloss), Look(preset="quality", samples=8))[0] for gloss in (0.0, 0.8)
    )
    assert to_linear(shiny).max() > to_linear(flat).max() + 0.1


def roughness(image: np.ndarray) -> float:
    """How much the middle of the ball differs from pixel to pixel, over its light."""
    light = to_linear(image)[38:58, 38:58, 1]
    return float(np.abs(np.diff(light, axis=1)).mean() / light.mean())


@pytest.mark.parametrize("preset", ["fast", "quality"])
def test_skin_has_a_relief_that_turns_with_the_head(shots: Shots, folder: Path, preset: str) -> None:
    look = Look(preset=preset, samples=None if preset == "fast" else 256, gloss=0.4)
    rough = replace(look, skin_detail=4.0)
    package = ball(folder)
    smooth, near = taken(shots, package, look, rough)
    assert roughness(near) > roughness(smooth) + 0.005
    assert to_linear(near).mean() == pytest.approx(to_linear(smooth).mean(), rel=0.03)
    turned = View((40.0, 0.0, 0.0), CAMERA, rough)
    [other] = shots.take(package, Views.of([turned]), Folders())
    assert np.abs(other[38:58, 38:58].astype(int) - near[38:58, 38:58]).mean() > 0.5


def test_what_is_finer_than_pixels_fades(shots: Shots, folder: Path) -> None:
    """The same image of a ball that is as large as a house: no noise of single pixels."""
    camera = Camera.square(96, 85.0, 700.0 * 30)
    views = Views.of([View((0.0, 0.0, 0.0), camera, Look(skin_detail=detail)) for detail in (0.0, 3.0)])
    smooth, rough = shots.take(ball(folder, scale=30.0), views, Folders())
    assert roughness(rough) < roughness(smooth) + 0.002


def test_what_is_no_skin_is_smooth(shots: Shots, folder: Path) -> None:
    for name, label in (("eye", "skin"), ("frame", "glasses")):
        package = ball(folder, name=name, label=label)
        smooth, rough = taken(shots, package, Look(), Look(skin_detail=3.0))
        np.testing.assert_array_equal(smooth, rough)


@pytest.mark.parametrize("preset", ["fast", "quality"])
def test_passes_know_nothing_of_it(renderer: Renderer, folder: Path, preset: str) -> None:
    found = []
    shaded = Look(preset=preset, skin_detail=3.0, gloss=0.6, occlusion=1.0, lamp1_strength=1.0)
    for look in (Look(preset=preset), shaded):
        views = Views.of([View((10.0, 5.0, 0.0), CAMERA, look)])
        [path] = renderer.render(ball(folder, 0.5), views, passes=["depth", "normal"])
        found.append(read_channels(path))
        path.unlink()
    for name, values in found[0].items():
        if "Combined" not in name:
            np.testing.assert_array_equal(values, found[1][name], err_msg=name)


def test_what_is_darker_than_skin_is_painted_on_it_and_shines_less(shots: Shots, folder: Path) -> None:
    """Half as light as the darkest skin, half the shine; black frames of glasses shine as they say."""
    half = (1.055 * 0.015 ** (1 / 2.4) - 0.055,) * 3
    shine = []
    for more in ({}, {"base_color": half}, {"base_color": half, "label": "glasses", "gloss": 0.6}):
        matt, glossy = taken(shots, ball(folder, **more), Look(ambient=0.1), Look(ambient=0.1, gloss=0.6))
        if "gloss" in more:
            matt = taken(shots, ball(folder, base_color=half), Look(ambient=0.1))[0]
        shine.append((to_linear(glossy) - to_linear(matt)).max())
    assert shine[1] == pytest.approx(shine[0] / 2, rel=0.1) and shine[2] == pytest.approx(shine[0], rel=0.1)


SHADED = (
    Look(skin_detail=1.0, gloss=0.5),
    Look(skin_detail=1.0, preset="quality", samples=2),
    Look(gloss=0.5),
    Look(lamp1_strength=0.5, lamp2_strength=0.5, environment="city", gloss=0.6),
    Look(lamp3_strength=0.8, lamp3_warmth=2.0),
    Look(gloss=0.5, lamp1_strength=0.4, preset="quality", samples=2),
    Look(occlusion=0.7),
    Look(occlusion=1.0, environment="city"),
    Look(occlusion=1.0, environment="city", preset="quality", samples=2),
)


def test_what_a_look_does_not_need_changes_no_pixel(shots: Shots, folder: Path) -> None:
    """Materials that can do more, because another look needed it, show a look to the same bytes."""
    plain = [Look(), Look(environment="sunset", environment_key=0.4), Look(preset="quality", samples=2)]
    package = ball(folder, 0.5)
    alone = [taken(shots, package, look)[0] for look in plain]
    shaded = [taken(shots, package, look)[0] for look in SHADED]
    mixed = taken(shots, package, *SHADED, *plain, *SHADED)
    for one, other in zip([*shaded, *alone, *shaded], mixed, strict=True):
        np.testing.assert_array_equal(one, other)
    # And it does something: no look is another's.
    for k, look in enumerate(SHADED):
        if look.preset == "fast":
            less = replace(
                look, occlusion=0.0, gloss=0.0, lamp1_strength=0.0, lamp3_strength=0.0, skin_detail=0.0
            )
            assert not np.array_equal(shaded[k], taken(shots, package, less)[0])


def test_a_look_is_the_same_whatever_looks_its_maps_lie_beside(shots: Shots, folder: Path) -> None:
    """More looks than an image of maps holds, each as it is alone; another gloss needs another layout."""
    package = ball(folder, 0.5)
    looks = [
        Look(
            gloss=0.5, occlusion=0.8, lamp1_strength=0.3 + 0.05 * k, lamp1_yaw_deg=9.0 * k, environment="city"
        )
        for k in range(19)
    ]
    together = taken(shots, package, *looks)
    for k in (0, 7, 15, 16, 18):
        np.testing.assert_array_equal(taken(shots, package, looks[k])[0], together[k])
    assert len({image.tobytes() for image in together}) == len(looks)


def test_what_is_put_on_later_shines_as_if_it_had_been_at_hand(shots: Shots, folder: Path) -> None:
    look = Look(gloss=0.5, lamp1_strength=0.5, lamp1_yaw_deg=30.0)
    package = ball(folder, scale=0.9)
    thing = ball(folder, scale=1.02, name="frame", label="glasses", gloss=0.33)
    views, worn = Views.of([View((0.0, 0.0, 0.0), CAMERA, look)]), ((Worn(str(thing), (0.0, 0.0, 0.0)),),)

    def dressed() -> np.ndarray:
        [image] = shots.take(package, views, Folders(), worn)
        return image

    [bare] = taken(shots, package, look)
    later = dressed()
    taken(shots, ball(folder, 0.7), look)  # another head: everything is made anew
    np.testing.assert_array_equal(later, dressed())
    assert np.abs(later.astype(int) - bare).max() > 20


def test_a_head_that_nobody_cast_rays_for_is_open(shots: Shots, folder: Path) -> None:
    plain, shaded = taken(shots, ball(folder), Look(), Look(occlusion=1.0))
    assert np.abs(plain.astype(int) - shaded).max() <= 1
