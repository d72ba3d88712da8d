# SPDX-License-Identifier: GPL-3.0-or-later
"""Factors: groups of settings of [render] that a twin changes together, and what it draws them from.

A factor is *plain* in an image where its settings have their defaults. One of a row and its twin is plain
and the other is not, so the difference of the two is the effect of the factor, with a sign: between two
draws from one distribution the mean difference is zero, whatever the factor does. stdlib only.

Whoever changes what a factor draws changes twins that are not yet built, and those of earlier datasets can no
longer be proved: raise the content version.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from generator.plan.setting import Choice
from generator.plan.shading import LAMPS
from generator.plan.wear import LENSES, STYLES

MARK = "~"
"""Between the name of a row's pose and the factor of its twin. No pose has one in its name."""


@dataclass(frozen=True)
class Factor:
    """One factor.

    meaning: for people. draws: setting -> what is drawn where the configuration itself draws nothing: the
    factor is plain where these have their defaults; "" for one that is not drawn without the configuration.
    along: likewise, of settings that say nothing by themselves, such as the direction of a motion.
    camera: it changes the camera instead of the look. worn: it may hide landmarks.
    """

    name: str
    meaning: str
    draws: Mapping[str, str]
    along: Mapping[str, str] = field(default_factory=dict)
    camera: bool = False
    worn: bool = False

    @property
    def settings(self) -> tuple[str, ...]:
        """The keys of [render] that its twins may change."""
        return (*self.draws, *self.along)


_ALONG = {
    "glasses": {"lenses": f"choice:{LENSES[0]},{','.join(LENSES)}"},
    "occluder": {"occluder_x": "normal:0,0.3", "occluder_y": "normal:0,0.3"},
}
"""Settings that say nothing without what is worn."""


def _worn(kind: str) -> Factor:
    """What a head wears: any style but the first, which adds nothing."""
    draws = {kind: f"choice:{','.join(STYLES[kind][1:])}"}
    return Factor(kind, f"{kind} of any style", draws, _ALONG.get(kind, {}), worn=True)


_EVERY = (
    Factor(
        "light",
        "the key light from anywhere in front, more or less light from all around; lamps and an environment "
        "where the configuration draws them",
        {
            "light_yaw_deg": "uniform:-100,100",
            "light_pitch_deg": "normal:35,20",
            "ambient": "uniform:0.15,0.75",
            "environment": "",
            **{f"lamp{lamp}_strength": "" for lamp in LAMPS},
        },
        {
            **dict.fromkeys(("environment_yaw_deg", "environment_strength", "environment_key"), ""),
            **{f"lamp{lamp}_{key}": "" for lamp in LAMPS for key in ("yaw_deg", "pitch_deg", "warmth")},
        },
    ),
    Factor(
        "lens",
        "the camera's distance, with the lens by which the head has the same share of the image",
        {"distance_mm": "log-uniform:400,8000", "lens_mm": ""},
        camera=True,
    ),
    Factor("backdrop", "what is behind the head", {"backdrop": "choice:noise"}, {"backdrop_picture": ""}),
    Factor("exposure", "lighter or darker", {"exposure_ev": "normal:0,1"}),
    Factor("tone", "white balance and tone curve", {"warmth": "normal:0,0.5", "contrast": "normal:0,0.4"}),
    Factor(
        "blur",
        "out of focus, and moved",
        {"defocus_px": "uniform:0.5,2", "motion_px": "uniform:0,4"},
        {"motion_deg": "uniform:-90,90"},
    ),
    Factor("detail", "a sensor of fewer pixels", {"detail": "uniform:0.25,0.7"}),
    Factor("noise", "noise of the sensor", {"noise": "log-uniform:0.005,0.05"}),
    Factor("jpeg", "a JPEG of lower quality", {"jpeg": "uniform:10,60"}),
    Factor(
        "skin",
        "skin that shines and has pores and furrows, and shade in sockets and nostrils",
        {"gloss": "uniform:0.3,0.8", "occlusion": "uniform:0.5,1", "skin_detail": "uniform:0.5,1.5"},
    ),
    *map(_worn, STYLES),
    Factor("thing", "one of your own things", {"thing": ""}, worn=True),
)

FACTORS: dict[str, Factor] = {factor.name: factor for factor in _EVERY}
"""Every factor by its name."""


def factor_choices() -> tuple[Choice, ...]:
    """The values of ``dataset.twins``."""
    return tuple(Choice(name) for name in FACTORS)


def row_name(pose: str, factor: str = "") -> str:
    """The last part of a row's sample_id: the name of its pose and, of a twin, its factor."""
    return f"{pose}{MARK}{factor}" if factor else pose


def part_folder(factor: str = "") -> str:
    """The folder of the tables of rows, or of twins: whoever reads the rows comes across no twin."""
    return "twins" if factor else "data"


PART_FOLDERS = (part_folder(), part_folder("any"))
"""Both."""


def is_twin(sample_id: str) -> bool:
    """Is it the name of a twin?"""
    return MARK in sample_id.rpartition("/")[2]
