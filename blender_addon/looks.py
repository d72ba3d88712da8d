# SPDX-License-Identifier: GPL-3.0-or-later
"""Looks of the head in view at its pose, drawn and rendered by the host as in builds with their seeds."""

from __future__ import annotations

import random
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import pictures, session, windows
from .core.conversation import OnAnswer
from .core.looks import SEEDS, Look
from .session import Shown
from .settings import chosen_head, look_config, pose, radius_mm


def roll(shown: Shown) -> None:
    """Show another look."""
    with session.quiet():
        shown.look_seed = random.SystemRandom().randrange(SEEDS)
    show(shown)


def show(shown: Shown) -> None:
    """Show the look of the seed that is named."""
    head, angles, seed = chosen_head(shown), pose(shown), shown.look_seed

    def take(answer: dict[str, Any]) -> None:
        pictures.keep(pictures.LOOK, Path(answer["pictures"][0]))
        session.state.look = Look(head, angles, seed, answer["drawn"][0], answer["left_out"][0])

    _request(shown, [seed], "rolling the dice...", take)


def sheet(shown: Shown, seeds: Sequence[int], columns: int) -> None:
    """Show the looks of some seeds in one picture."""

    def take(answer: dict[str, Any]) -> None:
        pictures.keep(pictures.LOOKS, Path(answer["sheet"]))
        windows.keep_image(pictures.LOOKS, answer["sheet"])

    _request(shown, seeds, "drawing a sheet of looks...", take, columns)


def _request(shown: Shown, seeds: Sequence[int], busy: str, on_answer: OnAnswer, columns: int = 0) -> None:
    kind = "sheet" if columns else "look"
    message = {
        "op": "looks",
        "config": look_config(shown),
        "package": shown.package,
        "head": "/".join(chosen_head(shown)),
        "radius_mm": radius_mm(shown),
        "pose": list(pose(shown)),
        "seeds": list(seeds),
        "folder": str(Path(tempfile.gettempdir()) / f"headturn-{kind}-{shown.id_data.name}"),
        "sheet": columns,
    }
    session.request(message, busy, on_answer)
