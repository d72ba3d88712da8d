# SPDX-License-Identifier: GPL-3.0-or-later
"""Views: a sequence that says what its members share once."""

from __future__ import annotations

import pytest

from generator.codec import from_plain, to_plain
from generator.errors import UsageError
from generator.geometry.camera import Camera, framing_distance
from generator.plan.config import BuildConfig, load_config
from generator.plan.settings import Look, Render
from generator.plan.view_plan import framed_camera, plan_views
from generator.plan.views import View, Views

POSES = ((0.0, 0.0, 0.0), (10.0, 0.0, 5.0), (-3.5, 2.0, 1.0))
NEAR, FAR = Camera.square(64, 85.0, 500.0), Camera(64, 48, 200.0, 3000.0, principal_px=(30.0, 20.0))


def test_what_is_shared_stands_once_and_what_differs_for_each() -> None:
    shared = Views.of([View(pose, NEAR, Look()) for pose in POSES])
    assert (len(shared), shared.cameras, shared.looks) == (3, (NEAR,), (Look(),))
    mixed = Views.of(
        [View(pose, camera, Look()) for pose, camera in zip(POSES, (NEAR, FAR, NEAR), strict=True)]
    )
    assert mixed.cameras == (NEAR, FAR, NEAR) and mixed.looks == (Look(),)
    assert [view.camera for view in mixed[1:]] == [FAR, NEAR]
    assert [view.pose for view in shared[:2]] == list(POSES[:2])
    assert shared[-1].pose == POSES[-1] and mixed[-1].camera == NEAR
    assert from_plain(Views, to_plain(mixed)) == mixed
    assert mixed.angles_deg.tolist() == [list(pose) for pose in POSES]
    assert Views((), (NEAR,), (Look(),)).angles_deg.shape == (0, 3)


def test_each_view_has_its_own_look_and_seed() -> None:
    every = [View(pose, NEAR, Look(ambient=k / 4), seed=k) for k, pose in enumerate(POSES)]
    together = Views.of(every)
    assert [*together] == every and [*together[1:]] == every[1:]


def test_another_number_of_cameras_is_refused() -> None:
    for name, count in (("cameras", 2), ("looks", 0), ("seeds", 4)):
        given = {"cameras": (NEAR,), "looks": (Look(),), "seeds": (0,)}
        with pytest.raises(ValueError, match=f"{name}: expected 1 or 3, got {count}"):
            Views(POSES, **{**given, name: given[name] * count})


def test_a_head_is_framed_unless_a_distance_is_given() -> None:
    expected = round(framing_distance(120.0, 85.0, 1.05), 2)
    assert framed_camera(Render(), 120.0) == Camera(256, 256, 85.0, expected)
    assert framed_camera(Render(distance_mm=2000.0), 120.0).distance_mm == 2000.0
    config = BuildConfig(render=Render(background=(0.0, 0.0, 1.0)))
    views = plan_views(config, "a/neutral", 120.0, POSES)
    assert views.looks[0].background == (0.0, 0.0, 1.0) and views.poses == POSES


@pytest.mark.parametrize(
    ("lens", "size", "principal"),
    [
        ({"aspect": 4.0}, (256, 64), None),
        ({"aspect": 0.25}, (64, 256), None),
        ({"shift_x": 0.12345}, (256, 256), (159.603, 128.0)),  # to a thousandth of a pixel
        ({"shift_y": -0.12345, "aspect": 2.0}, (256, 128), (128.0, 48.198)),
    ],
)
def test_the_image_and_where_the_pivot_is_in_it(lens: dict, size: tuple, principal: tuple | None) -> None:
    camera = framed_camera(Render(**lens), 120.0)
    assert ((camera.width, camera.height), camera.principal_px) == (size, principal)


def test_without_a_scene_there_is_no_camera_of_one() -> None:
    with pytest.raises(UsageError, match="remove --scene-camera"):
        framed_camera(Render(scene_camera=True), 120.0)


@pytest.mark.parametrize("random", [{"noise": 0.1}, {"backdrop": "noise"}])
def test_images_with_something_random_have_a_seed_each(random: dict) -> None:
    config = load_config(None, {"render": random})
    seeds = [plan_views(config, head, 120.0, POSES).seeds for head in ("a/neutral", "b/neutral")]
    reseeded = load_config(None, {"render": random, "poses": {"seed": 1}})
    seeds.append(plan_views(reseeded, "a/neutral", 120.0, POSES).seeds)
    assert len({seed for some in seeds for seed in some}) == 9


def test_the_look_of_a_plan_is_a_look_alone() -> None:
    """So that two plans that differ in lens alone have the same look, and messages say it once."""
    assert type(Render(lens_mm=50.0).look) is Look
    assert Render(lens_mm=50.0).look == Look()
