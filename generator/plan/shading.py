# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps, and how surfaces answer light, as settings of [render]. stdlib only."""

from __future__ import annotations

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
        default, f"Where lamp {lamp} stands, in the angles of the key light",
        unit="degrees", low=-180, high=180, flag=f"--lamp{lamp}", label=f"Lamp {lamp} yaw", varies=True,
        since="1.3.0",
    )  # fmt: skip


def _pitch(lamp: int, default: float) -> float:
    return setting(
        default, f"Height of lamp {lamp}", unit="degrees", low=-90, high=90, flag=f"--lamp{lamp}",
        label=f"Lamp {lamp} pitch", varies=True, since="1.3.0",
    )  # fmt: skip


def _strength(lamp: int) -> float:
    return setting(
        0.0, f"Strength of lamp {lamp}: at 1 surfaces that face it have their own colour; at 0 it is off",
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
        0.0, "Shade in sockets, nostrils and other hollows, in the fast preset; 1 is the shade that the "
        "head's shape gives, and quality always traces it",
        low=0, high=1, label="Occlusion", varies=True, since="1.3.0",
    )  # fmt: skip
    gloss: float = setting(
        0.0, "How much the skin shines: 0 is matt, 0.5 is skin, 0.8 is wet; above 0 eyes and teeth are wet",
        low=0, high=1, label="Gloss", varies=True, since="1.3.0",
    )  # fmt: skip

    skin_detail: float = setting(
        0.0, "Relief of the skin, from furrows of 2.5 mm to pores, where pixels are small enough; 1 is skin",
        low=0, high=4, label="Skin detail", varies=True, since="1.3.0",
    )  # fmt: skip

    @property
    def lamps(self) -> tuple[Lamp, ...]:
        """Those that are lit."""
        return tuple(self._lamp(number) for number in LAMPS if getattr(self, f"lamp{number}_strength") > 0)

    def _lamp(self, number: int) -> Lamp:
        names = ("yaw_deg", "pitch_deg", "strength", "warmth")
        return Lamp(*(getattr(self, f"lamp{number}_{name}") for name in names))


def unshaded(look: T) -> T:
    """A look with the defaults of all this."""
    plain: dict[str, Any] = {one.name: one.default for one in fields(Shading)}
    return replace(look, **plain)
