# SPDX-License-Identifier: GPL-3.0-or-later
"""``head.json``: what a subject's folder says about itself."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from generator.errors import HeadError
from generator.escape import quoted
from generator.heads.limits import MAX_EXPRESSIONS
from generator.reading import read_limited

CARD_NAME = "head.json"
MAX_CARD_BYTES = 1 << 22

Axis = Literal["+X", "-X", "+Y", "-Y", "+Z", "-Z"]


class CardExpression(BaseModel):
    """One mesh; further keys are the writer's own."""

    model_config = ConfigDict(strict=True, frozen=True)

    file: str


class HeadCard(BaseModel):
    """Trusted over every guess. ``expressions`` maps names to files in the folder."""

    model_config = ConfigDict(strict=True, frozen=True)

    source: str = "mesh"
    subject: str | None = None
    license: str = "unknown"
    redistributable: bool = False
    attribution: str = ""
    units: Literal["um", "mm", "cm", "dm", "m"] | None = None
    up: Axis | None = None
    forward: Axis | None = None
    expressions: dict[str, str | CardExpression] = Field(max_length=MAX_EXPRESSIONS)

    def files(self) -> dict[str, str]:
        """File name of each expression."""
        return {k: v if isinstance(v, str) else v.file for k, v in self.expressions.items()}


def read_card(path: Path) -> HeadCard:
    """The card in a file.

    Raises
    ------
    HeadError: no regular file, too large, not JSON, or a field is missing or of the wrong kind.
    """
    try:
        data = read_limited(path, MAX_CARD_BYTES)
    except ValueError as error:
        raise HeadError(f"{path} {error}") from error
    except OSError as error:
        raise HeadError(f"{path} cannot be read: {error.strerror}") from error
    try:
        return HeadCard.model_validate_json(data)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(str(part) for part in first["loc"]) or "the file"
        raise HeadError(f"{path}: {quoted(where)}: {' '.join(first['msg'].split())}; correct it") from error
