# SPDX-License-Identifier: GPL-3.0-or-later
"""What a head wears, as settings of [render], and which styles there are of it. stdlib only."""

from __future__ import annotations

from dataclasses import dataclass

from generator.plan.setting import setting

LENSES = ("clear", "tinted", "dark", "mirror")
"""Of glasses."""

OWN, NOTHING = "own", "none"
"""As the head has it; nothing."""

STYLES: dict[str, tuple[str, ...]] = {
    "hair": (
        OWN, "buzz", "short", "parted", "slick", "fringe", "bob", "long", "curly", "afro", "bun", "ponytail",
    ),
    "brows": (OWN, "natural", "thin", "thick"),
    "beard": (OWN, "stubble", "moustache", "goatee", "full", "long"),
    "glasses": (NOTHING, "round", "square", "aviator", "browline", "rimless", "cat-eye"),
    "headwear": (NOTHING, "cap", "beanie", "brimmed", "headscarf", "headband", "hard-hat"),
    "headphones": (NOTHING, "over-ear", "on-ear", "earbuds"),
    "mask": (NOTHING, "medical", "cloth", "ffp2"),
    "clothes": (NOTHING, "crew", "shirt", "turtleneck", "hoodie", "suit"),
    "occluder": (NOTHING, "hand", "phone", "mug", "microphone", "paper"),
}  # fmt: skip
"""Kind -> its styles, of which the first is the default and adds nothing."""


def _kind(name: str, what: str, label: str) -> str:
    first, *others = STYLES[name]
    return setting(first, f"{what}: {first}, or {', '.join(others)}", label=label, varies=True, since="1.3.0")


@dataclass(frozen=True)
class Wear:
    """What a head wears; see :mod:`generator.worn`."""

    hair: str = _kind("hair", "Hair", "Hair")
    brows: str = _kind("brows", "Brows", "Brows")
    beard: str = _kind("beard", "Beard", "Beard")
    glasses: str = _kind("glasses", "Glasses", "Glasses")
    lenses: str = setting(
        LENSES[0], f"Lenses of the glasses: {', '.join(LENSES)}", label="Lenses", varies=True, since="1.3.0"
    )
    headwear: str = _kind("headwear", "Headwear", "Headwear")
    headphones: str = _kind("headphones", "Headphones", "Headphones")
    mask: str = _kind("mask", "A mask over mouth and nose", "Mask")
    clothes: str = _kind("clothes", "Shoulders and their clothes", "Clothes")
    occluder: str = _kind("occluder", "A thing before the face", "Occluder")
    thing: str = setting(
        NOTHING, "One of your own things, by its name in --things; all draws from every one", label="Thing",
        varies=True, since="1.3.0",
    )  # fmt: skip
    occluder_x: float = setting(
        0.0, "How far right of the nose the occluder is, in widths of the face",
        low=-2, high=2, label="Occluder right", varies=True, since="1.3.0",
    )  # fmt: skip
    occluder_y: float = setting(
        0.0, "How far below the nose the occluder is, in widths of the face",
        low=-2, high=2, label="Occluder down", varies=True, since="1.3.0",
    )  # fmt: skip
    wear_variant: float = setting(
        0.0, "Colours, patterns and sizes of worn things: a number between 0 and 1",
        low=0, high=1, label="Variant", varies=True, since="1.3.0",
    )  # fmt: skip

    @property
    def wears(self) -> dict[str, str]:
        """Kind -> style of what is not as the head has it."""
        worn = {
            kind: getattr(self, kind) for kind, styles in STYLES.items() if getattr(self, kind) != styles[0]
        }
        return worn if self.thing == NOTHING else {**worn, "thing": self.thing}


@dataclass(frozen=True)
class Worn:
    """Something that a render worker shows with a head, turned as the head is.

    package: of :func:`generator.heads.package.save_package`. offset_mm: where it is moved, frame U of the
    head before it is turned.
    """

    package: str
    offset_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
