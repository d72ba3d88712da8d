# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``--variety`` stands for: distributions of settings of [render] that are not given. stdlib only."""

from __future__ import annotations

from generator.plan.setting import Choice

NONE = "none"

_PHOTO: dict[str, object] = {
    # Photographs of people are taken from arm's length to across a street, and zoomed or cut to the face.
    "distance_mm": "log-uniform:400,8000",
    "zoom": True,
    "margin": "uniform:1,2.2",
    "shift_x": "normal:0,0.06",
    "shift_y": "normal:0,0.06",
    "light_yaw_deg": "uniform:-100,100",
    "light_pitch_deg": "normal:35,20",
    "ambient": "uniform:0.15,0.75",
    "environment": "choice:all",
    "environment_yaw_deg": "uniform:-180,180",
    "environment_strength": "log-uniform:0.6,1.5",
    "environment_key": "choice:0,0,0,0.3",
    "backdrop": "choice:environment,environment,noise,plain",
    "background": ["normal:0.65,0.13", "normal:0.65,0.13", "normal:0.65,0.13"],
    "exposure_ev": "normal:0,0.4",
    "warmth": "normal:0,0.25",
    "contrast": "normal:0.1,0.25",
    "defocus_px": "choice:0,0,0,0.6,1.2",
    "motion_px": "choice:0,0,0,0,1.5,3",
    "motion_deg": "uniform:-90,90",
    "detail": "choice:1,1,1,0.6,0.35",
    "noise": "log-uniform:0.002,0.03",
    "jpeg": "uniform:45,98",
}

_ALL: dict[str, object] = {
    **_PHOTO,
    "distance_mm": "log-uniform:300,20000",
    "light_yaw_deg": "uniform:-180,180",
    "light_pitch_deg": "uniform:-30,90",
    "ambient": "uniform:0.05,0.95",
    "environment_strength": "log-uniform:0.3,3",
    "environment_key": "uniform:0,1",
    "background": ["uniform:0,1", "uniform:0,1", "uniform:0,1"],
    "exposure_ev": "normal:0,1",
    "warmth": "normal:0,0.6",
    "defocus_px": "uniform:0,3",
    "motion_px": "uniform:0,8",
    "detail": "uniform:0.15,1",
    "noise": "log-uniform:0.002,0.15",
    "jpeg": "uniform:10,98",
}

VARIETY: dict[str, dict[str, object]] = {NONE: {}, "photo": _PHOTO, "all": _ALL}

CHOICES = (
    Choice(NONE, "Every image as the settings say"),
    Choice("photo", "Cameras and light as in photographs"),
    Choice("all", "As photo, and farther than that in everything"),
)
