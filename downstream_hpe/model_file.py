# SPDX-License-Identifier: MIT
"""Facts and arrays as a model file keeps them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from downstream_hpe.errors import ModelError
from downstream_hpe.reading import check_regular, parse_json

MAX_BYTES = 1 << 30


def packed(form: str, facts: Mapping[str, object]) -> dict[str, str]:
    """Facts as the metadata of a safetensors file: one entry, as it keeps several in no fixed order."""
    return {"downstream-hpe": json.dumps({**facts, "format": form}, sort_keys=True)}


def unpacked(path: Path, form: str, metadata: Mapping[str, str] | None) -> dict[str, Any]:
    """The facts that :func:`packed` packed. ModelError unless they are of that format."""
    try:
        facts = parse_json((metadata or {})["downstream-hpe"])
        found = facts["format"]
    except (KeyError, TypeError, ValueError) as error:
        raise ModelError(f"{path}: not written by downstream-hpe; expected {form!r}") from error
    if found != form:
        raise ModelError(f"{path}: format {found!r}, expected {form!r}")
    return facts


def read_safetensors(path: Path, form: str) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    """Arrays and facts of a safetensors file. ModelError unless it is of that format."""
    from safetensors import SafetensorError, safe_open

    try:
        check_regular(path, MAX_BYTES)
        with safe_open(path, framework="numpy") as file:
            metadata = file.metadata()
            arrays = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a dict
    except (OSError, ValueError, SafetensorError) as error:
        raise ModelError(f"{path}: not a readable model file ({str(error).splitlines()[0]})") from error
    return arrays, unpacked(path, form, metadata)
