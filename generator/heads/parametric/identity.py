# SPDX-License-Identifier: GPL-3.0-or-later
"""Who a head is: MakeHuman's macro parameters and face details, sampled and turned into a shape."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache

import numpy as np

from generator.geometry.rigid import fit_similarity
from generator.heads.parametric.real_shape import PREFIX, real_shape
from generator.heads.parametric.source import base_mesh, target
from generator.heads.parametric.template import PARTS, head_template

ETHNICITIES = ("african", "asian", "caucasian")

HEAD_SHAPES = ("diamond", "invertedtriangular", "oval", "rectangular", "round", "square", "triangular")

# Detail targets: name, suffix for negative values, suffix for positive values, standard deviation.
# "{side}" stands for a left/right pair that moves together.
_DETAILS = (
    ("head/head-angle", "in", "out", 0.10),
    ("head/head-fat", "decr", "incr", 0.30),
    ("head/head-back-scale-depth", "decr", "incr", 0.18),
    ("head/head-scale-depth", "decr", "incr", 0.12),
    ("head/head-scale-horiz", "decr", "incr", 0.15),
    ("head/head-scale-vert", "decr", "incr", 0.10),
    ("forehead/forehead-nubian", "decr", "incr", 0.12),
    ("forehead/forehead-scale-vert", "decr", "incr", 0.12),
    ("forehead/forehead-temple", "decr", "incr", 0.20),
    ("forehead/forehead-trans", "backward", "forward", 0.15),
    ("eyebrows/eyebrows-angle", "down", "up", 0.30),
    ("eyebrows/eyebrows-trans", "backward", "forward", 0.30),
    ("eyebrows/eyebrows-trans", "down", "up", 0.30),
    ("eyes/{side}-eye-bag", "decr", "incr", 0.35),
    ("eyes/{side}-eye-bag-height", "decr", "incr", 0.25),
    ("eyes/{side}-eye-corner1", "down", "up", 0.25),
    ("eyes/{side}-eye-corner2", "down", "up", 0.30),
    ("eyes/{side}-eye-epicanthus", "in", "out", 0.25),
    ("eyes/{side}-eye-eyefold", "concave", "convex", 0.30),
    ("eyes/{side}-eye-eyefold", "down", "up", 0.25),
    ("eyes/{side}-eye-eyefold-angle", "down", "up", 0.25),
    ("eyes/{side}-eye-height1", "decr", "incr", 0.20),
    ("eyes/{side}-eye-height2", "decr", "incr", 0.20),
    ("eyes/{side}-eye-height3", "decr", "incr", 0.20),
    ("eyes/{side}-eye-scale", "decr", "incr", 0.25),
    ("eyes/{side}-eye-trans", "in", "out", 0.20),
    ("eyes/{side}-eye-trans", "down", "up", 0.15),
    ("nose/nose-base", "down", "up", 0.30),
    ("nose/nose-compression", "compress", "uncompress", 0.25),
    ("nose/nose-curve", "concave", "convex", 0.30),
    ("nose/nose-flaring", "decr", "incr", 0.35),
    ("nose/nose-greek", "decr", "incr", 0.30),
    ("nose/nose-hump", "decr", "incr", 0.30),
    ("nose/nose-nostrils-angle", "down", "up", 0.30),
    ("nose/nose-nostrils-width", "decr", "incr", 0.30),
    ("nose/nose-point", "down", "up", 0.30),
    ("nose/nose-point-width", "decr", "incr", 0.35),
    ("nose/nose-scale-depth", "decr", "incr", 0.30),
    ("nose/nose-scale-horiz", "decr", "incr", 0.30),
    ("nose/nose-scale-vert", "decr", "incr", 0.25),
    ("nose/nose-septumangle", "decr", "incr", 0.30),
    ("nose/nose-volume", "decr", "incr", 0.30),
    ("nose/nose-width1", "decr", "incr", 0.30),
    ("nose/nose-width2", "decr", "incr", 0.30),
    ("nose/nose-width3", "decr", "incr", 0.30),
    ("mouth/mouth-angles", "down", "up", 0.25),
    ("mouth/mouth-cupidsbow", "decr", "incr", 0.35),
    ("mouth/mouth-cupidsbow-width", "decr", "incr", 0.30),
    ("mouth/mouth-dimples", "in", "out", 0.25),
    ("mouth/mouth-laugh-lines", "in", "out", 0.25),
    ("mouth/mouth-lowerlip-height", "decr", "incr", 0.30),
    ("mouth/mouth-lowerlip-volume", "decr", "incr", 0.35),
    ("mouth/mouth-lowerlip-width", "decr", "incr", 0.25),
    ("mouth/mouth-philtrum-volume", "decr", "incr", 0.35),
    ("mouth/mouth-scale-horiz", "decr", "incr", 0.30),
    ("mouth/mouth-scale-vert", "decr", "incr", 0.20),
    ("mouth/mouth-trans", "down", "up", 0.25),
    ("mouth/mouth-upperlip-height", "decr", "incr", 0.30),
    ("mouth/mouth-upperlip-volume", "decr", "incr", 0.35),
    ("mouth/mouth-upperlip-width", "decr", "incr", 0.25),
    ("ears/{side}-ear-flap", "decr", "incr", 0.35),
    ("ears/{side}-ear-lobe", "decr", "incr", 0.35),
    ("ears/{side}-ear-rot", "backward", "forward", 0.30),
    ("ears/{side}-ear-scale", "decr", "incr", 0.25),
    ("ears/{side}-ear-scale-vert", "decr", "incr", 0.25),
    ("ears/{side}-ear-wing", "decr", "incr", 0.35),
    ("cheek/{side}-cheek-bones", "decr", "incr", 0.35),
    ("cheek/{side}-cheek-inner", "decr", "incr", 0.30),
    ("cheek/{side}-cheek-trans", "down", "up", 0.30),
    ("cheek/{side}-cheek-volume", "decr", "incr", 0.30),
    ("chin/chin-bones", "decr", "incr", 0.30),
    ("chin/chin-cleft", "decr", "incr", 0.30),
    ("chin/chin-height", "decr", "incr", 0.25),
    ("chin/chin-jaw-drop", "decr", "incr", 0.25),
    ("chin/chin-prognathism", "decr", "incr", 0.20),
    ("chin/chin-prominent", "decr", "incr", 0.30),
    ("chin/chin-width", "decr", "incr", 0.30),
    ("neck/neck-double", "decr", "incr", 0.25),
    ("neck/neck-scale-depth", "decr", "incr", 0.20),
    ("neck/neck-scale-horiz", "decr", "incr", 0.20),
)

_MEANS = {"mouth/mouth-angles": 0.12, "eyes/{side}-eye-height2": 0.08}
"""Details whose average is not 0: MakeHuman's neutral face looks stern."""

ETHNICITY_SHARE = 0.4
"""Of how far MakeHuman's ethnicities are apart: they are caricatures, which a detector reads as much as
9 degrees of pitch apart where it reads people about alike."""

DETAIL_SHARE = 0.6
"""Of the standard deviations above: much of how faces vary is in the factors of real faces."""

DETAIL_LIMIT = 2.0
"""Details stay within this many standard deviations (a full target is 1)."""

PAIR_JITTER = 0.04
"""Standard deviation of the difference that makes a left/right pair slightly unequal."""

_ASYMMETRY = ("brown-1", "cheek-1", "ear-1", "eye-1", "jaw-1", "jaw-2", "mouth-1", "nose-1", "temple-1")
ASYMMETRY_LIMIT = 0.15


@dataclass(frozen=True)
class Identity:
    """One person's shape parameters.

    gender: 0 female to 1 male. age_years: 20-75. muscle, weight: 0-1, 0.5 average.
    ethnicity: weights of ETHNICITIES, sum 1. targets: MakeHuman detail targets, and those of
    :mod:`generator.heads.parametric.real_shape`, and their weights.
    """

    gender: float
    age_years: float
    muscle: float
    weight: float
    ethnicity: dict[str, float]
    targets: dict[str, float]


def sample_identity(rng: np.random.Generator) -> Identity:
    """Draw a plausible adult."""
    gender = float(np.clip(rng.choice([0.03, 0.95]) + rng.normal(0, 0.06), 0, 1))
    age_years = float(20 + 55 * rng.beta(1.1, 1.7))
    muscle = float(np.clip(rng.normal(0.5 + 0.08 * (gender - 0.5), 0.15), 0.15, 0.85))
    weight = float(np.clip(rng.normal(0.52, 0.16), 0.2, 0.9))
    main = rng.permutation(3)
    share = rng.dirichlet([1.0, 0.25, 0.08]) * 0.6 + np.array([0.4, 0.0, 0.0])
    ethnicity = {ETHNICITIES[k]: float(s) for k, s in zip(main, share, strict=True)}

    targets: dict[str, float] = {}
    rare = ("rectangular", "square") if gender < 0.5 else ()
    shape = rng.dirichlet([0.16 if name in rare else 0.4 for name in HEAD_SHAPES]) * rng.uniform(0.1, 0.5)
    targets |= {f"head/head-{n}": float(v) for n, v in zip(HEAD_SHAPES, shape, strict=True) if v > 0.02}
    for name, negative, positive, deviation in _DETAILS:
        value = DETAIL_SHARE * _normal(rng, deviation) + _MEANS.get(name, 0.0)
        sides = ("l", "r") if "{side}" in name else ("",)
        for side in sides:
            own = value + (rng.normal(0, PAIR_JITTER) if side else 0.0)
            suffix = positive if own > 0 else negative
            targets[f"{name.format(side=side)}-{suffix}"] = float(abs(own))
    for name in _ASYMMETRY:
        side = "l" if rng.random() < 0.5 else "r"
        targets[f"asym/asym-{name}-{side}"] = float(rng.uniform(0, ASYMMETRY_LIMIT))
    for name in real_shape().targets:
        targets[name] = _normal(rng, 1.0)
    return Identity(gender, age_years, muscle, weight, dict(sorted(ethnicity.items())), targets)


def identity_vertices(identity: Identity) -> np.ndarray:
    """Vertices of the identity in source numbering, float64 [S, 3] dm; the face is level."""
    base = base_vertices()
    return levelled(apply_targets(base, macro_weights(identity) | identity.targets), base)


def levelled(vertices: np.ndarray, base: np.ndarray) -> np.ndarray:
    """Vertices [S, 3] dm turned so that their face is as level as another's, which has no expression.

    MakeHuman's people hold their heads by sex, age and ethnicity as much as 6 degrees up or down,
    which would be an error of their labels: pose zero is where the face is level.
    """
    front = _front_rows()
    turn = fit_similarity(vertices[front], base[front]).rotation
    middle = vertices[front].mean(0)
    return (vertices - middle) @ turn.T + middle


def macro_weights(identity: Identity) -> dict[str, float]:
    """Weights of the macro targets: products of the factors, as MakeHuman combines them.

    MakeHuman's age runs from "young" (25 years) to "old" (90 years).
    """
    old = float(np.clip((identity.age_years - 25) / 65, 0, 1))
    genders = {"female": 1 - identity.gender, "male": identity.gender}
    ages = {"young": 1 - old, "old": old}
    weights = {}
    for gender, gender_weight in genders.items():
        for age, age_weight in ages.items():
            both = gender_weight * age_weight
            for race, share in identity.ethnicity.items():
                shaped = 1 / 3 + ETHNICITY_SHARE * (share - 1 / 3)
                weights[f"macrodetails/{race}-{gender}-{age}"] = both * shaped
            for muscle, muscle_weight in _triangle(identity.muscle).items():
                for weight, share in _triangle(identity.weight).items():
                    name = f"macrodetails/universal-{gender}-{age}-{muscle}muscle-{weight}weight"
                    weights[name] = both * muscle_weight * share
    return {name: value for name, value in weights.items() if value > 0}


def apply_targets(vertices: np.ndarray, weights: dict[str, float]) -> np.ndarray:
    """A copy of vertices [S, 3] dm with every target added at its weight."""
    moved = vertices.copy()
    for name, weight in weights.items():
        rows, offsets = head_target(name)
        moved[rows] += weight * offsets
    return moved


@lru_cache(maxsize=1)
def base_vertices() -> np.ndarray:
    """The base mesh, shaped like people on average, in source numbering, float64 [S, 3] dm."""
    vertices = base_mesh().vertices[head_template().source_vertices]
    shape = real_shape()
    vertices[_source_rows()[shape.vertices]] += shape.correction
    return vertices


@cache
def head_target(name: str) -> tuple[np.ndarray, np.ndarray]:
    """A target cut to the head: rows in source numbering [K], offsets [K, 3] dm."""
    if name.startswith(PREFIX):
        shape = real_shape()
        return _source_rows()[shape.vertices], shape.targets[name]
    indices, offsets = target(name, _written_numbers())
    return _source_rows()[indices], offsets


@lru_cache(maxsize=1)
def _written_numbers() -> frozenset[str]:
    """Vertices of the base mesh that the head uses, as they are written in target files."""
    return frozenset(map(str, head_template().source_vertices.tolist()))


@lru_cache(maxsize=1)
def _front_rows() -> np.ndarray:
    """Vertices of the face's skin from chin to forehead, int [K]: as dense as the face is detailed."""
    template = head_template()
    skin = template.triangles[template.part == PARTS.index("skin")]
    rows = np.unique(template.refine[np.unique(skin)].indices)
    x, y, z = base_mesh().vertices[template.source_vertices[rows]].T
    return rows[(z > 1.0) & (y > 6.2) & (y < 8.0) & (np.abs(x) < 0.6)]


@lru_cache(maxsize=1)
def _source_rows() -> np.ndarray:
    """Source numbering of every vertex of the base mesh, -1 where the head does not use it."""
    rows = np.full(len(base_mesh().vertices), -1)
    source = head_template().source_vertices
    rows[source] = np.arange(len(source))
    return rows


def parameter_table() -> list[tuple[str, str, str]]:
    """(parameter, range, meaning) of everything :func:`sample_identity` draws, for the documentation."""
    rows = [
        ("gender", "0 to 1, around 0.03 or 0.95", "0 female, 1 male"),
        ("age_years", "20 to 75", "young and old macro targets"),
        ("muscle", "0.15 to 0.85", "0.5 is average"),
        ("weight", "0.2 to 0.9", "0.5 is average"),
        ("ethnicity", "weights with sum 1, one of them at least 0.4", ", ".join(ETHNICITIES)),
        ("head/head-{shape}", "0 to 0.5 together", ", ".join(HEAD_SHAPES)),
    ]
    for name, negative, positive, deviation in _DETAILS:
        limit, mean = DETAIL_LIMIT * DETAIL_SHARE * deviation, _MEANS.get(name, 0.0)
        span = f"{mean - limit:.2f} to {mean + limit:.2f}"
        rows.append((f"{name}-{negative}/{positive}", span, "detail target"))
    for name in _ASYMMETRY:
        rows.append((f"asym/asym-{name}-l/r", f"0 to {ASYMMETRY_LIMIT}", "slight asymmetry"))
    span = f"-{DETAIL_LIMIT:g} to {DETAIL_LIMIT:g}"
    rows += [(name, span, "factor of how real faces vary") for name in real_shape().targets]
    return rows


def _triangle(value: float) -> dict[str, float]:
    return {"min": max(0.0, 1 - 2 * value), "average": 1 - abs(2 * value - 1), "max": max(0.0, 2 * value - 1)}


def _normal(rng: np.random.Generator, deviation: float) -> float:
    return float(np.clip(rng.normal(0, deviation), -DETAIL_LIMIT * deviation, DETAIL_LIMIT * deviation))
