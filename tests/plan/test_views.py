# SPDX-License-Identifier: GPL-3.0-or-later
"""Views: a sequence that says what its members share once."""

from __future__ import annotations

import pytest

from generator.codec import from_plain, to_plain
from generator.geometry.camera import Camera, framing_distance
from generator.plan.config import BuildConfig
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


def test_another_number_of_cameras_is_refused() -> None:
    with pytest.raises(ValueError, match="cameras: expected 1 or 3, got 2"):
        Views(POSES, (NEAR, FAR), (Look(),))


def test_a_head_is_framed_unless_a_distance_is_given() -> None:
    expected = round(framing_distance(120.0, 85.0, 1.05), 2)
    assert framed_camera(Render(), 120.0) == Camera(256, 256, 85.0, expected)
    assert framed_camera(Render(distance_mm=2000.0), 120.0).distance_mm == 2000.0
    config = BuildConfig(render=Render(background=(0.0, 0.0, 1.0)))
    views = plan_views(config, "a/neutral", 120.0, POSES)
    assert views.looks[0].background == (0.0, 0.0, 1.0) and views.poses == POSES


def test_the_look_of_a_plan_is_a_look_alone() -> None:
    """So that two plans that differ in lens alone have the same look, and messages say it once."""
    assert type(Render(lens_mm=50.0).look) is Look
    assert Render(lens_mm=50.0).look == Look()
