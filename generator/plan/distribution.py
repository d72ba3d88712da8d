# SPDX-License-Identifier: GPL-3.0-or-later
"""What a setting may be instead of one value: a distribution that each image, or each head, draws from.

Written ``uniform:LOW,HIGH``, ``log-uniform:LOW,HIGH``, ``normal:MEAN,SD`` or ``choice:A,B,...``, with
``head:`` before it where all images of a head share one draw. stdlib only: Blender imports it, too.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

KINDS = ("uniform", "log-uniform", "normal", "choice")
PER_HEAD = "head:"

DIGITS = 6
"""Significant digits of what is drawn: the number in a table is the number that was used."""

TRIES = 1000
"""A normal distribution is drawn from until the value is one that the setting may have."""


class Random(Protocol):
    """Of a numpy.random.Generator what is used here."""

    def random(self) -> float:
        """In [0, 1)."""
        ...

    def standard_normal(self) -> float:
        """Of mean 0 and standard deviation 1."""
        ...


@dataclass(frozen=True)
class Distribution:
    """A distribution of numbers within the limits of a setting, or of texts.

    kind: of KINDS. numbers: those behind its name. low, high: of the setting; None is no limit.
    per_head: one draw for all images of a person, whatever the expression. texts: what is chosen from where
    the setting is a text.
    """

    kind: str
    numbers: tuple[float, ...] = ()
    low: float | None = None
    high: float | None = None
    per_head: bool = False
    texts: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """As it is written."""
        behind = ",".join(self.texts or (f"{number:.12g}" for number in self.numbers))
        return f"{PER_HEAD if self.per_head else ''}{self.kind}:{behind}"

    @property
    def middle(self) -> float | str:
        """What stands for it where one value is needed: the median, or the first choice."""
        if self.texts:
            return self.texts[0]
        first, *others = self.numbers
        if self.kind == "uniform":
            return (first + others[0]) / 2
        return math.sqrt(first * others[0]) if self.kind == "log-uniform" else first

    def draw(self, rng: Random) -> float | str:
        """One value, with DIGITS significant digits."""
        if self.texts:
            return self.texts[int(rng.random() * len(self.texts))]
        for _ in range(TRIES):
            value = float(f"{self._value(rng):.{DIGITS}g}")
            if (self.low is None or value >= self.low) and (self.high is None or value <= self.high):
                return value
        return self.middle

    def _value(self, rng: Random) -> float:
        first, second = self.numbers[0], self.numbers[-1]
        if self.kind == "normal":
            return first + second * rng.standard_normal()
        share = rng.random()
        if self.kind == "uniform":
            return first + share * (second - first)
        if self.kind == "log-uniform":
            return math.exp(math.log(first) + share * (math.log(second) - math.log(first)))
        return self.numbers[int(share * len(self.numbers))]


def is_distribution(value: object) -> bool:
    """Is it the text of a distribution, right or wrong, of a number? A number is not."""
    return isinstance(value, str) and ":" in value


def is_choice(value: object) -> bool:
    """Is it the text of a distribution of texts?"""
    return isinstance(value, str) and value.removeprefix(PER_HEAD).startswith("choice:")


def parse_choice(text: str) -> Distribution:
    """A choice of texts as it is written. Raises ValueError, which says what is wrong with it."""
    texts = tuple(text.removeprefix(PER_HEAD).removeprefix("choice:").split(","))
    if not all(texts):
        raise ValueError("expected texts separated by commas behind choice:")
    return Distribution("choice", per_head=text.startswith(PER_HEAD), texts=texts)


def parse_distribution(text: str, low: float | None = None, high: float | None = None) -> Distribution:
    """A distribution as it is written, of values between low and high.

    Raises ValueError, which says what is wrong with it.
    """
    per_head = text.startswith(PER_HEAD)
    kind, _, behind = text.removeprefix(PER_HEAD).partition(":")
    if kind not in KINDS:
        raise ValueError(f"no distribution {kind!r}; there are {', '.join(KINDS)}")
    try:
        numbers = tuple(float(word) for word in behind.split(","))
    except ValueError as error:
        raise ValueError(f"expected numbers separated by commas behind {kind}:") from error
    if not all(map(math.isfinite, numbers)):
        raise ValueError("expected numbers that are finite")
    if kind != "choice" and len(numbers) != 2:
        raise ValueError(f"expected two numbers behind {kind}:")
    first, second = numbers[0], numbers[-1]
    if kind.endswith("uniform") and first > second:
        raise ValueError(f"the low end {first:g} is above the high end {second:g}")
    if kind == "log-uniform" and first <= 0:
        raise ValueError(f"the low end {first:g} has no logarithm; give more than 0")
    if kind == "normal" and second < 0:
        raise ValueError(f"the standard deviation {second:g} is below 0")
    for number in numbers[:1] if kind == "normal" else numbers:
        if (low is not None and number < low) or (high is not None and number > high):
            span = f"from {'any' if low is None else f'{low:g}'} to {'any' if high is None else f'{high:g}'}"
            raise ValueError(f"{number:g} is outside what the setting may be, {span}")
    return Distribution(kind, numbers, low, high, per_head)
