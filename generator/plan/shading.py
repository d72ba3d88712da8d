# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps, and how surfaces answer light, as settings of [render]. stdlib only."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any, TypeVar

from generator.plan.setting import setting

LAMPS = (1, 2, 3)


@dataclass(frozen=True)
class Lamp:
    """A lamp besides the key light. warmth: stops of red against blue."""

    yaw_deg: float
    pitch_deg: float
    strength: float
    warmth: float


def _yaw(lamp: int, default: float) -> float:
    return setting(
        default, f"Where lamp {lamp} stands, as the key light", unit="degrees", low=-180, high=180,
        flag=f"--lamp{lamp}", label=f"Lamp {lamp} yaw", varies=True, since="1.3.0",
    )  # fmt: skip


def _pitch(lamp: int, default: float) -> float:
    return setting(
        default, f"Height of lamp {lamp}", unit="degrees", low=-90, high=90, flag=f"--lamp{lamp}",
        label=f"Lamp {lamp} pitch", varies=True, since="1.3.0",
    )  # fmt: skip


def _strength(lamp: int) -> float:
    return setting(
        0.0, f"Strength of lamp {lamp}: at 1 it lights what faces it to its own colour; at 0 there is none",
        low=0, high=10, label=f"Lamp {lamp} strength", varies=True, since="1.3.0",
    )  # fmt: skip


def _warmth(lamp: int) -> float:
    return setting(
        0.0, f"Colour of lamp {lamp}: stops of red against blue", unit="stops", low=-4, high=4,
        label=f"Lamp {lamp} warmth", varies=True, since="1.3.0",
    )  # fmt: skip


T = TypeVar("T", bound="Shading")


@dataclass(frozen=True)
class Shading:
    """Lamps, and how surfaces answer light; with the defaults as in every release before 1.3."""

    lamp1_yaw_deg: float = _yaw(1, -60.0)
    lamp1_pitch_deg: float = _pitch(1, 10.0)
    lamp1_strength: float = _strength(1)
    lamp1_warmth: float = _warmth(1)
    lamp2_yaw_deg: float = _yaw(2, 140.0)
    lamp2_pitch_deg: float = _pitch(2, 30.0)
    lamp2_strength: float = _strength(2)
    lamp2_warmth: float = _warmth(2)
    lamp3_yaw_deg: float = _yaw(3, -140.0)
    lamp3_pitch_deg: float = _pitch(3, 30.0)
    lamp3_strength: float = _strength(3)
    lamp3_warmth: float = _warmth(3)
    occlusion: float = setting(
        0.0, "How much darker sockets, nostrils and whatever else is closed in are, in the fast preset; 1 is "
        "what the head's shape says, and quality traces it in any case",
        low=0, high=1, label="Occlusion", varies=True, since="1.3.0",
    )  # fmt: skip
    gloss: float = setting(
        0.0, "How much the skin shines: 0 is matt, 0.5 is skin, 0.8 is wet; above 0 eyes and teeth are wet",
        low=0, high=1, label="Gloss", varies=True, since="1.3.0",
    )  # fmt: skip

    skin_detail: float = setting(
        0.0, "Relief of the skin, from furrows of 2.5 mm to pores, as far as pixels are fine: 1 is skin",
        low=0, high=4, label="Skin detail", varies=True, since="1.3.0",
    )  # fmt: skip

    @property
    def lamps(self) -> tuple[Lamp, ...]:
        """Those that are lit."""
        return tuple(lamp for lamp in self._lamps() if lamp.strength > 0)

    def _lamps(self) -> Iterator[Lamp]:
        for lamp in LAMPS:
            names = ("yaw_deg", "pitch_deg", "strength", "warmth")
            yield Lamp(*(getattr(self, f"lamp{lamp}_{name}") for name in names))


def unshaded(look: T) -> T:
    """A look with the defaults of all this."""
    plain: dict[str, Any] = {one.name: one.default for one in fields(Shading)}
    return replace(look, **plain)
