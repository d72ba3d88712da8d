# SPDX-License-Identifier: MIT
"""From where a dataset counts its angles: each mesh's own zero, or one that its heads were turned to."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from downstream_hpe.errors import DataError
from downstream_hpe.reading import MAX_STATE_BYTES, parse_json, read_limited

MANIFEST = "manifest.json"


def pose_zero(dataset: Path | str) -> str | None:
    """`--frame` of the build, "source", "level" or "canonical"; None of files without their manifest.

    Raises
    ------
    DataError: a manifest that is not one of headturn build.
    """
    file = Path(dataset) / MANIFEST
    if not file.exists():
        return None
    try:
        frame = parse_json(read_limited(file, MAX_STATE_BYTES))["configuration"]["poses"]["frame"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DataError(f"{file}: not a readable manifest; headturn build writes it again") from error
    return str(frame)


def common_zero(datasets: Sequence[Path]) -> str | None:
    """The zero that all datasets share; None where it is not known of all.

    Raises
    ------
    DataError: two that differ. Their angles differ by a few degrees a head, mostly in pitch.
    """
    zeros = {dataset: pose_zero(dataset) for dataset in datasets}
    known = {dataset: zero for dataset, zero in zeros.items() if zero is not None}
    for dataset, zero in known.items():
        first = next(iter(known))
        if zero != known[first]:
            raise DataError(
                f"{dataset}: built with --frame {zero}, but {first} with --frame {known[first]}; "
                "build both with the same one"
            )
    return next(iter(known.values())) if known and len(known) == len(zeros) else None
