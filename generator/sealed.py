# SPDX-License-Identifier: GPL-3.0-or-later
"""JSON with a checksum of itself: what a flipped bit, a crash or an editor changed is not believed.

A checksum finds accidents. Whoever means harm can compute it too, so what a sealed record says is
compared with something independent wherever it decides anything.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from generator.reading import MAX_STATE_BYTES, parse_json, read_limited

SEAL = "sha256"
"""The key of the checksum, the last of its record."""


def seal_of(record: Mapping[str, Any]) -> str:
    """SHA-256, hex, of a record without its seal, as JSON with sorted keys."""
    rest = {key: value for key, value in record.items() if key != SEAL}
    text = json.dumps(rest, sort_keys=True, ensure_ascii=False, separators=(",", ":"), allow_nan=True)
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def sealed(record: Mapping[str, Any]) -> dict[str, Any]:
    """A record with its seal."""
    return {**record, SEAL: seal_of(record)}


def unsealed(value: Any) -> dict[str, Any]:
    """A record without the seal it came with. Raises ValueError: it is none, or the seal is not its own."""
    if not isinstance(value, dict) or SEAL not in value:
        raise ValueError("not a record with a checksum")
    if value[SEAL] != seal_of(value):
        raise ValueError("was changed after it was written (its checksum differs)")
    return {key: item for key, item in value.items() if key != SEAL}


def sealed_line(record: Mapping[str, Any]) -> str:
    """A record as one line."""
    return json.dumps(sealed(record))


def read_sealed_lines(path: Path) -> Iterator[dict[str, Any]]:
    """The records of a file of sealed lines; none if it is not there. Lines that do not hold are left out:
    whatever they vouched for is looked at again.

    Raises OSError or ValueError if the file cannot be read at all.
    """
    if not path.exists():
        return
    for line in read_limited(path, MAX_STATE_BYTES).split(b"\n"):
        try:
            yield unsealed(parse_json(line))
        except ValueError:  # also bytes that are no text
            continue
