# SPDX-License-Identifier: GPL-3.0-or-later
"""What the page says about a dataset besides its maps: heads, licences, how it was built."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from generator.dataset.format.build_files import LOG_FILE
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest, configuration_digest
from generator.dataset.show.report.atlas import Atlas
from generator.errors import DatasetError
from generator.reading import MAX_STATE_BYTES, parse_json, read_limited

MAX_SECONDS = 1e9
"""Of a stage of a unit; more was not measured."""
MAX_STAGES = 64
"""There are eight."""


def head_facts(
    heads: Sequence[HeadRow], pictures: Sequence[str | None], atlas: Atlas
) -> list[dict[str, Any]]:
    """A card a head."""
    return [
        {
            "subject": head.subject,
            "expression": head.expression,
            "split": head.split,
            "source": head.source,
            "license": head.license,
            "redistributable": head.redistributable,
            "attribution": head.attribution,
            "problems": list(head.problems),
            "frame": head.frame,
            "anchors": atlas.topology.count - head.anchor_absent,
            "anchor_residual_mm": _number(head.anchor_residual_mm),
            "src": picture,
            **atlas.of_head(head.subject, head.expression),
        }
        for head, picture in zip(heads, pictures, strict=True)
    ]


def build_facts(root: Path, manifest: Manifest) -> dict[str, Any]:
    """Configuration, versions, digest, the command that rebuilds it, and what took how long."""
    return {
        "command": manifest.created_by,
        "digest": manifest.digest,
        "schema_version": manifest.schema_version,
        "configuration_digest": configuration_digest(manifest.configuration),
        "configuration": _flat(manifest.configuration),
        "versions": dict(sorted(manifest.versions.items())),
        "skipped": list(manifest.skipped),
        "failures": manifest.failures,
        "timings": timings(root / LOG_FILE),
    }


def timings(log: Path) -> dict[str, float] | None:
    """Lane seconds a stage, summed over the units that the log of the build names; None without any.

    Lines that say something else are passed over, and such as a build did not live to end.
    Raises DatasetError: the log is no regular file, too large, or cannot be read.
    """
    if not log.exists():
        return None
    try:
        lines = read_limited(log, MAX_STATE_BYTES).decode("utf-8", "replace").splitlines()
    except OSError as error:
        raise DatasetError(f"{log}: cannot be read ({error.strerror}); remove it") from error
    except ValueError as error:
        raise DatasetError(f"{log}: {error}; remove it") from error
    total: dict[str, float] = defaultdict(float)
    for line in lines:
        for stage, seconds in _seconds(line).items():
            if stage in total or len(total) < MAX_STAGES:
                total[stage] += seconds
    return {stage: round(seconds, 2) for stage, seconds in total.items()} or None


def _seconds(line: str) -> dict[str, float]:
    """Those of a unit; none of any other line."""
    _, _, event = line.partition(" ")
    kind, _, facts = event.partition(" ")
    if kind != "unit":
        return {}
    try:
        stages = parse_json(facts)["seconds"].items()
    except (ValueError, KeyError, TypeError, AttributeError):
        return {}
    return {stage: value for stage, value in stages if isinstance(value, float) and 0 <= value < MAX_SECONDS}


def why_no_atlas(heads: Sequence[HeadRow], atlas: Atlas) -> str:
    """Why there is nothing to compare the detector with; "" if there is."""
    if atlas.overall["compared"]:
        return ""
    if all(head.anchor_absent == atlas.topology.count for head in heads):
        return (
            "No head of this dataset has exact landmarks: no face was found on its front, so nothing could "
            "be anchored to its mesh, or it was made before they were recorded (schema 1.0). The error of "
            "the detector cannot be said."
        )
    return "The detector found no face on any head that has exact landmarks, so there is nothing to compare."


def _flat(values: dict[str, Any], before: str = "") -> list[tuple[str, str]]:
    """Nested settings as ("section.key", value); those that are not set are left out."""
    rows: list[tuple[str, str]] = []
    for key, value in values.items():
        if isinstance(value, dict):
            rows += _flat(value, f"{before}{key}.")
        elif value not in (None, [], ()):
            text = ", ".join(f"{item}" for item in value) if isinstance(value, (list, tuple)) else f"{value}"
            rows.append((before + key, text))
    return rows


def _number(value: float) -> float | None:
    return round(value, 3) if math.isfinite(value) else None
