# SPDX-License-Identifier: GPL-3.0-or-later
"""What people type as option values, turned into configuration values."""

from __future__ import annotations

from typing import Any

from generator.errors import UsageError


def given(**sections: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """Sections with only the values that were given on the command line."""
    return {name: {k: v for k, v in values.items() if v is not None} for name, values in sections.items()}


def numbers(option: str, text: str | None) -> list[float] | None:
    """Numbers separated by commas. UsageError names the option."""
    if text is None:
        return None
    try:
        return [float(word) for word in text.split(",")]
    except ValueError as error:
        raise UsageError(f"{option} {text!r}: expected numbers separated by commas") from error


def pose_source(text: str | None) -> dict[str, Any]:
    """Settings of a plan named grid, uniform:N, sobol:N, or by the path of a CSV file."""
    if text is None:
        return {}
    kind, _, count = text.partition(":")
    if kind == "grid" and not count:
        return {"kind": "grid"}
    if kind in ("uniform", "sobol"):
        if not count.isdigit():
            raise UsageError(f"--poses {text!r}: say how many, such as {kind}:500")
        return {"kind": kind, "count": int(count)}
    return {"kind": "csv", "path": text}


def light(text: str | None) -> dict[str, float]:
    """Settings of the key light from YAW,PITCH in degrees."""
    angles = numbers("--light", text)
    if angles is None:
        return {}
    if len(angles) != 2:
        raise UsageError(f"--light {text!r}: expected YAW,PITCH in degrees, such as 25,35")
    return {"light_yaw_deg": angles[0], "light_pitch_deg": angles[1]}
