# SPDX-License-Identifier: GPL-3.0-or-later
"""What the host was, or would be, asked about: the keys of what it found, and what it found for a scene.

A key says all that an answer follows from. So an answer goes when somebody edits any of that, chooses another
head, opens another file or another scene, and is there again after undo.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Hashable
from typing import Any

from generator.plan.settings import Values

from . import own, session, settings
from .core.found import NOTHING, HeadName, Listing, Placed, Points
from .core.looks import Look
from .session import Shown


def source(config: Values) -> str:
    """Of the heads of a configuration."""
    return _digest(config.get("heads", {}))


def package(config: Values) -> str:
    """Of how these heads are placed."""
    return _digest([config.get("heads", {}), config.get("poses", {}).get("frame")])


def at_pose(shown: Shown) -> Hashable:
    """Of landmarks: head, pose and look."""
    config = settings.still_config(shown)
    return _view(shown), settings.pose(shown), _digest([config.get("render"), config.get("landmarks")])


def of_plan(shown: Shown) -> Hashable:
    """Of the outermost poses."""
    config = settings.to_config(shown)
    return _view(shown), _digest([config.get(name) for name in ("render", "landmarks", "poses")])


def of_look(shown: Shown) -> Hashable:
    """Of the dice: the head, and what they draw from. Their pose and seed are said beside the picture."""
    return _view(shown), _digest(settings.look_config(shown).get("render"))


def of_sheet(shown: Shown) -> Hashable:
    """Of a sheet of looks, beside which nothing is said."""
    return of_look(shown), settings.pose(shown)


def listing(shown: Shown) -> Listing:
    """The heads of the source that is named, as they were listed last, perhaps before the file was saved."""
    key = source(settings.to_config(shown))
    return session.state.lists.of(key) or Listing.read(shown.listed, key) or NOTHING


def placed(shown: Shown) -> Placed | None:
    """The head in view."""
    return Placed.read(shown.placed) if own.head(shown) is not None else None


def landmarks(shown: Shown) -> Points | None:
    """What was found at the pose in view."""
    return session.state.landmarks.of(at_pose(shown)) if own.head(shown) is not None else None


def extremes(shown: Shown) -> str:
    """What was found at the outermost poses."""
    return session.state.extremes.of(of_plan(shown)) or ""


def look(shown: Shown) -> Look | None:
    """What the dice showed last."""
    return session.state.look.of(of_look(shown))


def has_sheet(shown: Shown) -> bool:
    """Is there a sheet of looks?"""
    return session.state.sheet.of(of_sheet(shown)) is not None


def viewed(shown: Shown) -> HeadName:
    """The head in view, or the chosen one where none is."""
    there = Placed.read(shown.placed)
    return there.head if there is not None else settings.chosen_head(shown)


def _view(shown: Shown) -> Hashable:
    """The head as it was placed."""
    return (shown.package, shown.radius) if own.head(shown) is not None else None


def _digest(values: Any) -> str:
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[:16]
