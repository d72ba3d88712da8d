# SPDX-License-Identifier: GPL-3.0-or-later
"""What ``--variety`` stands for: distributions of settings of [render] that are not given. stdlib only."""

from __future__ import annotations

from generator.plan.setting import Choice
from generator.plan.wear import STYLES

NONE = "none"


def _some(kind: str, share: float, *, of_head: bool = False) -> str:
    """Any style of something worn in about such a share of the images, or of the heads, else the first."""
    first, *others = STYLES[kind]
    plain = [first] * round(len(others) * (1 - share) / share)
    return f"{'head:' if of_head else ''}choice:{','.join([*plain, *others])}"


_WEAR: dict[str, object] = {
    # Hair, beard and clothes are a person's, as are colours; the rest is put on and taken off.
    "hair": _some("hair", 0.75, of_head=True),
    "brows": _some("brows", 0.25, of_head=True),
    "beard": _some("beard", 0.15, of_head=True),
    "clothes": _some("clothes", 0.9, of_head=True),
    "glasses": _some("glasses", 0.25),
    "lenses": "choice:clear,clear,clear,clear,tinted,dark,mirror",
    "headwear": _some("headwear", 0.15),
    "headphones": _some("headphones", 0.05),
    "mask": _some("mask", 0.06),
    "occluder": _some("occluder", 0.06),
    "occluder_x": "normal:0,0.4",
    "occluder_y": "normal:0.3,0.4",
    "wear_variant": "head:uniform:0,1",
}

_SHADING: dict[str, object] = {
    # A flash or a window beside the light of the place, seldom a lamp behind the head; skin is a person's.
    "lamp1_strength": "choice:0,0,0,0.2,0.4",
    "lamp1_yaw_deg": "uniform:-110,110",
    "lamp1_pitch_deg": "uniform:-20,60",
    "lamp1_warmth": "normal:0,0.8",
    "lamp2_strength": "choice:0,0,0,0,0.4,0.8",
    "lamp2_yaw_deg": "choice:-160,-140,-120,120,140,160",
    "lamp2_pitch_deg": "uniform:0,60",
    "lamp2_warmth": "normal:0,1",
    "occlusion": "uniform:0.7,1",
    "gloss": "head:uniform:0.3,0.55",
    "skin_detail": "head:uniform:0.4,1",
}

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
    "environment_strength": "log-uniform:0.5,1.2",
    "environment_key": "choice:0,0,0,0.3",
    "backdrop": "choice:environment,environment,noise,plain",
    "background": ["normal:0.65,0.09", "normal:0.65,0.09", "normal:0.65,0.09"],
    **_SHADING,
    **_WEAR,
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
    "lamp1_strength": "choice:0,0,0.3,0.6,1.2",
    "lamp1_yaw_deg": "uniform:-180,180",
    "lamp1_pitch_deg": "uniform:-60,90",
    "lamp1_warmth": "normal:0,2",
    "lamp2_strength": "choice:0,0,0.5,1,2",
    "lamp2_warmth": "normal:0,2",
    "lamp3_strength": "choice:0,0,0,0.5,1",
    "lamp3_yaw_deg": "uniform:-180,180",
    "lamp3_pitch_deg": "uniform:-60,90",
    "lamp3_warmth": "normal:0,2",
    "occlusion": "uniform:0,1",
    "gloss": "uniform:0,0.8",
    "skin_detail": "uniform:0,2",
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
    Choice("photo", "Cameras, light and people as in photographs"),
    Choice("all", "As photo, and farther than that in everything"),
)
