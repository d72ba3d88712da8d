# SPDX-License-Identifier: MIT
"""The manifolds as a picture."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from downstream_hpe.geometry.rotation import ANGLES
from downstream_hpe.manifold.cosines import Manifolds, cosines
from downstream_hpe.manifold.tucker import Decomposition


def plot_manifolds(
    fit: Decomposition, manifolds: Manifolds, axes_deg: tuple[np.ndarray, ...], path: Path
) -> None:
    """The columns of the pose factors (dots) and their curves (lines), one panel an angle."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 3.6), layout="constrained")
    panels = figure.subplots(1, 3)
    for panel, name, axis, factor, params in zip(
        panels, ANGLES, axes_deg, fit.poses, manifolds.params, strict=True
    ):
        fine = np.linspace(axis[0], axis[-1], 400)
        panel.set_prop_cycle(None)
        lines = panel.plot(fine, cosines(params, fine))
        for k, line in enumerate(lines):
            line.set_label(f"{k + 1}: beta {params[k, 1]:.2f}")
            panel.plot(axis, factor[:, k], "o", markersize=4, color=line.get_color())
        panel.set(xlabel=f"{name} (degrees)", title=f"A({name[0]})")
        panel.grid(alpha=0.3)
        panel.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=3)
    panels[0].set_ylabel("factor")
    figure.savefig(path, dpi=150)
