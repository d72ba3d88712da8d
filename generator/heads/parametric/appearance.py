# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head looks like beyond its shape: skin, hair, beard, brows and eyes, sampled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from generator.heads.parametric.identity import Identity

SKIN_TONES = (
    np.array(
        [
            [240, 208, 188],
            [229, 187, 160],
            [211, 162, 128],
            [178, 126, 92],
            [136, 90, 63],
            [97, 63, 46],
            [66, 44, 35],
        ]
    )
    / 255.0
)
"""sRGB of unshaded skin for melanin 0 to 1, evenly spaced."""

HAIR_COLORS = {
    "black": (0.055, 0.047, 0.043),
    "dark brown": (0.135, 0.09, 0.065),
    "brown": (0.25, 0.16, 0.105),
    "light brown": (0.40, 0.28, 0.18),
    "blond": (0.62, 0.48, 0.30),
    "red": (0.45, 0.20, 0.09),
}
GREY_HAIR = (0.66, 0.65, 0.63)

EYE_COLORS = {
    "dark brown": (0.17, 0.095, 0.055),
    "brown": (0.33, 0.19, 0.10),
    "hazel": (0.42, 0.32, 0.16),
    "green": (0.36, 0.44, 0.30),
    "blue": (0.38, 0.47, 0.56),
    "grey": (0.44, 0.48, 0.50),
}

HAIR_STYLES = ("bald", "shaved", "short", "medium", "long")
BEARDS = ("none", "stubble", "moustache", "goatee", "full")


@dataclass(frozen=True)
class Appearance:
    """Paint parameters. Weights are 0-1; lengths are decimetres of the base mesh.

    melanin: place in SKIN_TONES. redness: blood in cheeks, nose and ears.
    hairline: height of the front hairline over the usual one; recession: depth of
    the bare temples; volume_mm: thickness of the hair on the crown; fringe: how far
    it falls over the forehead.
    curtain_end: height of the tips of long hair on the base mesh; curtain_angle: how
    far from the face it opens, degrees (above 100: tucked behind the ears).
    ageing: wrinkles, 0 at 25 years to 1 at 80.
    """

    melanin: float
    redness: float
    mottle: float
    freckles: float
    moles: int
    ageing: float
    lip_color: float
    lip_red: float
    brow_density: float
    brow_width: float
    brow_height: float
    hair_color: str
    hair_shade: float
    grey: float
    hair_style: str
    hairline: float
    recession: float
    volume_mm: float
    fringe: float
    curtain_end: float
    curtain_angle: float
    beard: str
    beard_density: float
    eye_color: str
    lashes: float
    lip_makeup: float


def sample_appearance(rng: np.random.Generator, identity: Identity) -> Appearance:
    """Draw an appearance that goes with the identity's ethnicity, sex and age."""
    share = identity.ethnicity
    male = identity.gender > 0.5
    ageing = float(np.clip((identity.age_years - 25) / 55, 0, 1))
    centre = 0.68 * share["african"] + 0.28 * share["asian"] + 0.15 * share["caucasian"]
    melanin = float(np.clip(centre + rng.normal(0, 0.10), 0.02, 0.98))

    fair = share["caucasian"] * float(melanin < 0.3)
    names = list(HAIR_COLORS)
    odds = np.array([1.2, 1.5, 0.05 + 1.4 * fair, 1.2 * fair, 1.0 * fair, 0.5 * fair])
    hair = names[int(rng.choice(len(names), p=odds / odds.sum()))]
    eyes = list(EYE_COLORS)
    light = 1.6 * fair
    odds = np.array([1.0, 1.0, 0.1 + 0.5 * light, 0.35 * light, 0.9 * light, 0.35 * light])
    eye = eyes[int(rng.choice(len(eyes), p=odds / odds.sum()))]

    if male:
        odds = np.array([0.10 + 0.25 * ageing, 0.25, 0.45, 0.15, 0.03])
    else:
        odds = np.array([0.0, 0.05, 0.20, 0.33, 0.42])
    style = HAIR_STYLES[int(rng.choice(len(HAIR_STYLES), p=odds / odds.sum()))]
    volume = {"bald": (0, 0), "shaved": (0.5, 2), "short": (4, 10), "medium": (9, 18), "long": (7, 13)}[style]
    beard = BEARDS[int(rng.choice(len(BEARDS), p=[0.40, 0.36, 0.06, 0.07, 0.11]))] if male else "none"
    fringe = style in ("medium", "long") and rng.random() < 0.3
    tucked = rng.random() < 0.4
    made_up = not male and rng.random() < 0.45
    return Appearance(
        melanin=melanin,
        redness=float(rng.uniform(0.3, 1.0)),
        mottle=float(rng.uniform(0.4, 1.0)),
        freckles=float(rng.uniform(0.3, 1.0)) if rng.random() < 0.1 + 0.25 * fair else 0.0,
        moles=int(rng.integers(0, 5)),
        ageing=ageing,
        lip_color=float(rng.uniform(0.4, 0.75) if male else rng.uniform(0.5, 0.95)),
        lip_red=float(rng.uniform(0.0, 1.0)),
        brow_density=float(rng.uniform(0.65, 1.0) if male else rng.uniform(0.5, 0.95)),
        brow_width=float(rng.uniform(0.9, 1.35) if male else rng.uniform(0.55, 0.9)),
        brow_height=float(rng.normal(0.016 if male else 0.028, 0.008)),
        hair_color=hair,
        hair_shade=float(rng.uniform(0.8, 1.25)),
        grey=float(np.clip(rng.normal(1.5 * ageing - 0.45, 0.3), 0, 1)),
        hair_style=style,
        hairline=float(np.clip(rng.normal(0.02 + 0.05 * ageing * male, 0.05), -0.07, 0.14)),
        recession=float(np.clip(rng.normal(0.05 + 0.22 * ageing, 0.06), 0, 0.4)) if male else 0.02,
        volume_mm=float(rng.uniform(*volume)),
        fringe=float(rng.uniform(0.1, 0.28)) if fringe else 0.0,
        curtain_end=float(rng.uniform(5.95, 6.8)),
        curtain_angle=float(rng.uniform(106, 112) if tucked else rng.uniform(57, 72)),
        beard=beard,
        beard_density=float(rng.uniform(0.3, 0.9)),
        eye_color=eye,
        lashes=float(rng.uniform(0.15, 0.3) if male else rng.uniform(0.3, 0.5)),
        lip_makeup=float(rng.uniform(0.25, 0.8)) if made_up else 0.0,
    )


def skin_tone(melanin: float) -> np.ndarray:
    """sRGB [3] of unshaded skin."""
    place = melanin * (len(SKIN_TONES) - 1)
    return np.array([np.interp(place, np.arange(len(SKIN_TONES)), SKIN_TONES[:, k]) for k in range(3)])


def hair_tone(look: Appearance) -> np.ndarray:
    """sRGB [3] of the hair, greyed."""
    color = np.array(HAIR_COLORS[look.hair_color]) * look.hair_shade
    return color + (np.array(GREY_HAIR) - color) * look.grey * 0.9
