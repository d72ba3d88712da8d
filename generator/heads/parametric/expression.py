# SPDX-License-Identifier: GPL-3.0-or-later
"""Expressions: plausible mixtures of face units, with gaze."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from generator.heads.head import NEUTRAL
from generator.heads.made import expression_name
from generator.heads.parametric.identity import ETHNICITIES, Identity

GAZE_LIMIT = (25.0, 14.0)
"""Largest gaze to a side and up or down, degrees."""

_UNIT_GAZE = 35.0
"""Gaze, degrees, at which the eyeLook units are fully on."""

# Ranges of face-unit weights. A name with "{side}" is a left/right pair; names in lower
# case are MakeHuman's own expression units, blended over the identity's ethnicity.
_MOUTHS = {
    "closed": {"mouthPress{side}": (0.0, 0.4), "mouthShrugLower": (0.0, 0.3)},
    "smile": {
        "mouthSmile{side}": (0.3, 0.9),
        "cheekSquint{side}": (0.1, 0.5),
        "mouthDimple{side}": (0.0, 0.3),
    },
    "grin": {
        "mouthSmile{side}": (0.4, 0.8),
        "jawOpen": (0.06, 0.16),
        "mouthUpperUp{side}": (0.15, 0.40),
        "mouthLowerDown{side}": (0.1, 0.35),
        "cheekSquint{side}": (0.2, 0.6),
    },
    "laugh": {
        "mouthSmile{side}": (0.4, 0.8),
        "jawOpen": (0.25, 0.55),
        "mouthUpperUp{side}": (0.1, 0.35),
        "cheekSquint{side}": (0.3, 0.7),
    },
    "open": {"jawOpen": (0.25, 0.8)},
    "talk": {"jawOpen": (0.05, 0.30), "mouthStretch{side}": (0.0, 0.4), "mouthLowerDown{side}": (0.0, 0.4)},
    "round": {"jawOpen": (0.12, 0.35), "mouthFunnel": (0.3, 0.8)},
    "pucker": {"mouthPucker": (0.3, 0.85)},
    "frown": {"mouthFrown{side}": (0.3, 0.8), "mouthShrugLower": (0.1, 0.5), "neck-platysma": (0.0, 0.4)},
    "sneer": {
        "noseSneer{side}": (0.3, 0.8),
        "mouthUpperUp{side}": (0.1, 0.4),
        "nose-compression": (0.0, 0.5),
    },
    "left": {"mouthLeft": (0.2, 0.6), "jawLeft": (0.0, 0.4)},
    "right": {"mouthRight": (0.2, 0.6), "jawRight": (0.0, 0.4)},
    "puff": {"cheekPuff": (0.3, 0.9)},
    "rolled": {"mouthRollLower": (0.2, 0.6), "mouthRollUpper": (0.1, 0.5)},
    "jaw forward": {"jawForward": (0.3, 0.8)},
}
_MOUTH_ODDS = (1.5, 2.2, 1.5, 1.2, 1.3, 1.5, 0.8, 0.8, 1.0, 0.7, 0.35, 0.35, 0.4, 0.5, 0.3)

_BROWS = {
    "rest": {},
    "raised": {"browInnerUp": (0.2, 0.9), "browOuterUp{side}": (0.2, 0.8)},
    "lowered": {"browDown{side}": (0.25, 0.9)},
    "worried": {"browInnerUp": (0.35, 0.9), "browDown{side}": (0.0, 0.3)},
    "one up": {"browOuterUpLeft": (0.3, 0.8)},
}
_BROW_ODDS = (3.0, 1.5, 1.5, 1.0, 0.4)

_LIDS = {
    "rest": {},
    "wide": {"eyeWide{side}": (0.2, 0.7)},
    "squint": {"eyeSquint{side}": (0.2, 0.8)},
    "narrowed": {"eyeBlink{side}": (0.15, 0.45)},
    "closed": {"eyeBlink{side}": (1.0, 1.0)},
    "wink": {"eyeBlinkLeft": (1.0, 1.0), "cheekSquintLeft": (0.2, 0.6)},
}
_LID_ODDS = (3.2, 0.9, 1.1, 1.3, 0.7, 0.2)


@dataclass(frozen=True)
class Expression:
    """Weights of face units, and where the eyes look.

    mouth, brows, lids: names of the mixtures. units: face unit -> weight 0-1.
    gaze_right_deg: towards +x (the subject's left); gaze_up_deg: towards +y.
    """

    mouth: str = "rest"
    brows: str = "rest"
    lids: str = "rest"
    units: dict[str, float] | None = None
    gaze_right_deg: float = 0.0
    gaze_up_deg: float = 0.0


NEUTRAL_EXPRESSION = Expression(units={})


def sample_expression(rng: np.random.Generator) -> Expression:
    """Draw a mouth, brows, lids and a gaze that go together."""
    mouth, brows, lids = (
        _choose(rng, table, odds)
        for table, odds in ((_MOUTHS, _MOUTH_ODDS), (_BROWS, _BROW_ODDS), (_LIDS, _LID_ODDS))
    )
    units: dict[str, float] = {}
    for ranges in (_MOUTHS[mouth], _BROWS[brows], _LIDS[lids]):
        for name, (low, high) in ranges.items():
            value = rng.uniform(low, high)
            sides = ("Left", "Right") if "{side}" in name else ("",)
            for side in sides:
                own = value * (rng.normal(1, 0.06) if side and high < 1 else 1)
                units[name.format(side=side)] = float(np.clip(own, 0, 1))
    right, up = (float(np.clip(rng.normal(0, s / 2), -s, s)) for s in GAZE_LIMIT)
    if lids == "closed":
        right = up = 0.0
    for name, angle in (("Up", up), ("Down", -up)):
        if angle > 0:
            for side in ("Left", "Right"):
                units[f"eyeLook{name}{side}"] = angle / _UNIT_GAZE
    for name, angle in (("OutLeft", right), ("InRight", right), ("InLeft", -right), ("OutRight", -right)):
        if angle > 0:
            units[f"eyeLook{name}"] = angle / _UNIT_GAZE
    return Expression(mouth, brows, lids, units, right, up)


def expressions_of(seed: int, index: int, sampled: int) -> Iterator[tuple[str, Expression]]:
    """The neutral face of head ``index`` of a seed, and so many that are sampled, each with its name."""
    yield NEUTRAL, NEUTRAL_EXPRESSION
    for number in range(1, sampled + 1):
        yield expression_name(number), sample_expression(np.random.default_rng([seed, index, 4, number]))


def expression_targets(expression: Expression, identity: Identity) -> dict[str, float]:
    """Target name -> weight, for :func:`generator.heads.parametric.identity.apply_targets`."""
    weights: dict[str, float] = {}
    for name, value in (expression.units or {}).items():
        if value == 0:
            continue
        if name.islower():
            for race in ETHNICITIES:
                weights[f"expression/units/{race}/{name}"] = value * identity.ethnicity[race]
        else:
            weights[f"unit:{name}"] = value
    return weights


def unit_table() -> list[tuple[str, str, str, str]]:
    """(group, mixture, face unit, range) of everything that is drawn, for the documentation."""
    return [
        (group, mixture, name, f"{low:g} to {high:g}")
        for group, table in (("mouth", _MOUTHS), ("brows", _BROWS), ("lids", _LIDS))
        for mixture, ranges in table.items()
        for name, (low, high) in ranges.items()
    ]


def _choose(rng: np.random.Generator, table: dict, odds: tuple[float, ...]) -> str:
    share = np.array(odds) / sum(odds)
    return list(table)[int(rng.choice(len(table), p=share))]
