# SPDX-License-Identifier: GPL-3.0-or-later
"""Looks of the head in view at its pose, drawn and rendered by the host as in builds with their seeds."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from . import folders, keys, pictures, session, windows
from .core.conversation import OnAnswer
from .core.looks import SEEDS, Look
from .session import Shown
from .settings import look_config, pose, radius_mm


def roll(shown: Shown) -> None:
    """Show another look."""
    with session.quiet():
        shown.look_seed = random.SystemRandom().randrange(SEEDS)
    show(shown)


def show(shown: Shown) -> None:
    """Show the look of the seed that is named."""
    head, angles, seed, key = keys.viewed(shown), pose(shown), shown.look_seed, keys.of_look(shown)

    def take(answer: dict[str, Any]) -> None:
        pictures.keep(pictures.LOOK, Path(answer["pictures"][0]))
        session.state.look.take(key, Look(head, angles, seed, answer["drawn"][0], answer["left_out"][0]))

    _request(shown, [seed], "rolling the dice...", take)


def sheet(shown: Shown, seeds: Sequence[int], columns: int) -> None:
    """Show the looks of some seeds in one picture."""
    key = keys.of_sheet(shown)

    def take(answer: dict[str, Any]) -> None:
        pictures.keep(pictures.LOOKS, Path(answer["sheet"]))
        windows.keep_image(pictures.LOOKS, answer["sheet"])
        session.state.sheet.take(key, answer["sheet"])

    _request(shown, seeds, "drawing a sheet of looks...", take, columns)


def _request(shown: Shown, seeds: Sequence[int], busy: str, on_answer: OnAnswer, columns: int = 0) -> None:
    kind = "sheet" if columns else "look"
    message = {
        "op": "looks",
        **folders.told(look_config(shown)),
        "package": shown.package,
        "head": "/".join(keys.viewed(shown)),
        "radius_mm": radius_mm(shown),
        "pose": list(pose(shown)),
        "seeds": list(seeds),
        "folder": str(folders.scratch(kind)),
        "sheet": columns,
    }
    session.request(message, busy, on_answer)
