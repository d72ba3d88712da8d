# SPDX-License-Identifier: GPL-3.0-or-later
"""What each factor does, on the page: the ablation, and pairs of images of every factor."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from generator.dataset.ablate.ablation import ablation_of
from generator.dataset.ablate.pairs import Pairs, read_pairs
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import read_samples
from generator.dataset.show.report.tiles import picture_uri
from generator.geometry.rotation import geodesic_deg

SHOWN, SHOWN_PX = 3, 112
"""Pairs of each factor, and the side of their images in pixels."""


def collect_twins(root: Path, manifest: Manifest) -> dict[str, Any] | None:
    """What the page shows of twins; None where there are none. Reads rows and twins once.

    Raises DatasetError: a part or an image is missing or damaged.
    """
    if not manifest.twins:
        return None
    every = read_pairs(root)
    found = ablation_of(every).as_dict()
    for factor, pairs in zip(found["factors"], every, strict=True):
        factor["examples"] = _examples(root, manifest, pairs)
    return found


def _examples(root: Path, manifest: Manifest, pairs: Pairs) -> list[dict[str, Any]]:
    """Pairs nearest to the front, of one person each; none of a dataset without images."""
    if manifest.images == "none":
        return []
    turn = geodesic_deg(np.broadcast_to(np.eye(3), pairs.rotation.shape), pairs.rotation)
    nearest: dict[str, int] = {}
    for place in np.argsort(turn, kind="stable").tolist():
        nearest.setdefault(str(pairs.subjects[place]), place)
    chosen = list(nearest.values())[:SHOWN]
    ids = [(pairs.plain_ids[place], pairs.with_ids[place]) for place in chosen]
    rows = read_samples(root, manifest, [name for pair in ids for name in pair])
    return [
        {
            side: {
                "name": name,
                "src": picture_uri(root, rows[name], SHOWN_PX),
                "found": rows[name]["detected"],
            }
            for side, name in zip(("plain", "with"), pair, strict=True)
        }
        for pair in ids
    ]
