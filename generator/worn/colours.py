# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of things as they are in the world, sRGB 0-1, and how they are drawn."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

Colour = tuple[float, float, float]

ACETATE: dict[Colour, float] = {
    (0.05, 0.05, 0.055): 6,
    (0.16, 0.10, 0.07): 3,
    (0.10, 0.13, 0.22): 2,
    (0.30, 0.08, 0.10): 1,
    (0.23, 0.24, 0.26): 2,
    (0.20, 0.23, 0.17): 1,
    (0.86, 0.84, 0.80): 1,
    (0.62, 0.12, 0.13): 1,
    (0.55, 0.38, 0.24): 1,
}
"""Of frames of plastic, with how often."""

METAL: dict[Colour, float] = {
    (0.78, 0.63, 0.36): 3,
    (0.74, 0.74, 0.75): 3,
    (0.28, 0.28, 0.30): 3,
    (0.08, 0.08, 0.09): 3,
    (0.76, 0.52, 0.44): 1,
    (0.35, 0.24, 0.17): 1,
}

CLOTH: dict[Colour, float] = {
    (0.07, 0.07, 0.08): 5,
    (0.90, 0.89, 0.86): 3,
    (0.13, 0.17, 0.28): 4,
    (0.42, 0.43, 0.45): 3,
    (0.60, 0.11, 0.13): 2,
    (0.35, 0.11, 0.15): 1.5,
    (0.16, 0.29, 0.20): 1.5,
    (0.36, 0.36, 0.24): 1.5,
    (0.72, 0.63, 0.48): 2,
    (0.80, 0.62, 0.18): 1,
    (0.33, 0.50, 0.66): 1.5,
    (0.83, 0.60, 0.62): 1,
    (0.42, 0.31, 0.50): 0.7,
    (0.42, 0.28, 0.19): 1.5,
}

SKIN: dict[Colour, float] = {
    (0.93, 0.76, 0.66): 3,
    (0.87, 0.67, 0.55): 3,
    (0.77, 0.56, 0.43): 2,
    (0.60, 0.41, 0.30): 2,
    (0.42, 0.28, 0.20): 1.5,
    (0.29, 0.19, 0.14): 1,
}


def drawn(palette: Mapping[Colour, float], rng: np.random.Generator, spread: float = 0.02) -> Colour:
    """One colour of a palette, each number moved by spread (a standard deviation)."""
    colours, weights = [*palette], np.array([*palette.values()])
    base = np.array(colours[int(rng.choice(len(colours), p=weights / weights.sum()))])
    r, g, b = np.clip(base + spread * rng.standard_normal(3), 0.015, 0.97).tolist()
    return r, g, b


def mottled(
    points: np.ndarray, light: Colour, dark: Colour, rng: np.random.Generator, size_mm: float
) -> np.ndarray:
    """Colours of vertices [V, 3] between two, smoothly and at random, such as tortoiseshell: float [V, 3]."""
    waves = rng.standard_normal((6, 3)) * (2 * np.pi / size_mm) * 0.6
    phase = rng.random(6) * 2 * np.pi
    value = np.sin(points @ waves.T + phase).mean(axis=1) * 1.6
    share = np.clip(0.5 + value, 0, 1)[:, None]
    return (1 - share) * np.array(dark) + share * np.array(light)


def luminance(colour: Colour) -> float:
    """Between 0 and 1."""
    return float(np.dot(colour, (0.2126, 0.7152, 0.0722)))
