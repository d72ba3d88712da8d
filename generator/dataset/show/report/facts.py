# SPDX-License-Identifier: GPL-3.0-or-later
"""What the page says about a dataset besides its maps: heads, licences, how it was built."""

from __future__ import annotations

import json
import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest, configuration_digest
from generator.dataset.show.report.atlas import Atlas

LOG_FILE = "build.log"


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
    """Lane seconds a stage, summed over the units that the log of the build names; None without any."""
    if not log.is_file():
        return None
    total: dict[str, float] = defaultdict(float)
    for line in log.read_text(encoding="utf-8", errors="replace").splitlines():
        _, _, event = line.partition(" ")
        kind, _, facts = event.partition(" ")
        if kind == "unit":
            for stage, seconds in json.loads(facts).get("seconds", {}).items():
                total[stage] += seconds
    return {stage: round(seconds, 2) for stage, seconds in total.items()} or None


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
