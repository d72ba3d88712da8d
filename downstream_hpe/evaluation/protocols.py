# SPDX-License-Identifier: MIT
"""The protocols of the papers by name: which labels count, of which files, and how many there are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.evaluation.photographs import LARGEST_DEG
from downstream_hpe.evaluation.scored_rows import Measured
from downstream_hpe.evaluation.scores import BOUNDS_DEG, within_bounds

EVERY_DEG = (180.0, 180.0, 180.0)


@dataclass(frozen=True)
class Protocol:
    """bounds_deg: of yaw, pitch and roll, either side of zero. formats: those it is about; empty: any.
    labels: how many the papers have, by format, where they say so."""

    bounds_deg: tuple[float, float, float]
    formats: tuple[str, ...] = ()
    labels: Mapping[str, int] = field(default_factory=dict)


PROTOCOLS = {
    "paper-bounds": Protocol(BOUNDS_DEG),
    "99": Protocol((LARGEST_DEG,) * 3, labels={"aflw2000": 1969}),
    "fsanet-biwi": Protocol((LARGEST_DEG,) * 3, ("biwi-npz",), {"biwi-npz": 13219}),
    "biwi-15677": Protocol(EVERY_DEG, ("biwi", "biwi-colour"), {"biwi": 15677, "biwi-colour": 15677}),
}
"""paper-bounds: the grid of NLML-HPE (Ghafourian and Sukno). 99: HopeNet's filter of AFLW2000-3D (Ruiz,
Chong and Rehg, CVPR workshops 2018, datasets.py). fsanet-biwi: what is left where MTCNN finds a face and
keeps to it from frame to frame, BIWI_noTrack.npz of FSA-Net (Yang et al., CVPR 2019, TYY_create_db_biwi.py).
biwi-15677: every frame of the Kinect database, which some papers count as 15,677 and some as 15,678."""


def check_protocol(name: str, layout: str) -> None:
    """UsageError: a protocol of other files than of this format."""
    formats = PROTOCOLS[name].formats
    if formats and layout not in formats:
        raise UsageError(f"--protocol {name} is about --format {' or '.join(formats)}, not {layout}")


def under(name: str, layout: str, measured: Measured, path: Path, note: Callable[[str], None]) -> Measured:
    """Only the rows that a protocol counts, found or missed. DataError: none found."""
    protocol = PROTOCOLS[name]
    inside = within_bounds(measured.rows.ypr_deg, protocol.bounds_deg)
    bounds = ", ".join(f"{bound:g}" for bound in protocol.bounds_deg)
    if not inside.any():
        raise DataError(f"{path}: no pose within {bounds} degrees; use --all")
    missed_deg = measured.missed_deg[within_bounds(measured.missed_deg, protocol.bounds_deg)]
    if not inside.all():
        note(f"{int((~inside).sum())} rows outside {bounds} degrees left out")
    count = int(inside.sum()) + len(missed_deg)
    expected = protocol.labels.get(layout, count)
    if count != expected:
        note(f"{count} labels, and protocol {name} has {expected}: not comparable with the papers")
    own = measured.own_points
    return replace(
        measured,
        rows=measured.rows.take(inside),
        missed_deg=missed_deg,
        own_points=None if own is None else own[inside],
    )
