# SPDX-License-Identifier: GPL-3.0-or-later
"""What a verification proved, refuted and counted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from typing import Any

from generator.dataset.show.detection import Cell
from generator.escape import printable
from generator.words import plural

SHOWN = 3
"""How many of the same problem are named; the rest are counted."""

WORST = 5

PROVED = (
    "proved: every row of the plan is there once and agrees with heads, poses and configuration; "
    "every file has its recorded hash"
)
NO_IMAGES = "not proved: that images show what was recorded (--deep renders them again)"
OTHER_IMAGES = "not proved: that the other images show what was recorded (--deep all)"
NO_ORIGIN = (
    "not proved: that nobody recorded it all anew, hashes included "
    "(--digest with the Merkle root that its maker tells you)"
)
CHECKSUM = "the digest you expected is a checksum: it finds damage; against deceit, expect the Merkle root"

NOT_CHECKED = "not checked, because of the problems above"


@dataclass
class Check:
    """One thing that was proved or refuted. problems holds the first few of count."""

    name: str
    problems: list[str] = field(default_factory=list)
    count: int = 0
    done: bool = False

    @property
    def ok(self) -> bool:
        """Was it checked, and is it so?"""
        return self.done and not self.count

    @property
    def detail(self) -> str:
        """One line: what is wrong, the first few named; "" if nothing is."""
        if self.count:
            more = f" and {self.count - len(self.problems)} more" if self.count > len(self.problems) else ""
            return "; ".join(self.problems) + more
        return "" if self.done else NOT_CHECKED

    def add(self, problems: Iterable[str]) -> None:
        """Count problems and keep the first few."""
        for problem in problems:
            self.count += 1
            if len(self.problems) < SHOWN:
                self.problems.append(problem)

    def merge(self, other: Check) -> None:
        """Count what another check of the same thing found after this one."""
        self.problems += other.problems[: SHOWN - len(self.problems)]
        self.count += other.count


@dataclass(frozen=True)
class Deep:
    """What was done to show that images are those of their rows.

    chosen: rows; all_rows: were they all? seed: that chose them. images: as the manifest has them.
    decoded: images that are one, of the right kind and size. rendered: rows that were rendered again
    and compared. not_rendered: reason -> rows. versions: what rendered then and now, where it differs.
    """

    chosen: int
    all_rows: bool
    seed: int
    images: str
    decoded: int
    rendered: int
    not_rendered: dict[str, int]
    versions: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Was every chosen row rendered again?"""
        return self.rendered == self.chosen

    def lines(self) -> list[str]:
        """For people."""
        which = "all rows" if self.all_rows else f"{plural(self.chosen, 'row')}, chosen with seed {self.seed}"
        seen = "no images are stored" if self.images == "none" else f"{plural(self.decoded, 'image')} decoded"
        said = [f"{which}: {seen}, {self.rendered} rendered again and compared"]
        said += [f"  {count} not rendered again: {why}" for why, count in self.not_rendered.items()]
        if self.versions:
            said.append(f"  other versions may render other images: {'; '.join(self.versions)}")
        return said


@dataclass(frozen=True)
class Twins:
    """The twins of a dataset. digest, merkle_root: of those that were read; "" where none were."""

    rows: int
    factors: tuple[str, ...]
    digest: str = ""
    merkle_root: str = ""

    def line(self) -> str:
        """For people."""
        said = f"{plural(self.rows, 'twin')} of rows, with {', '.join(self.factors) or 'nothing'} changed"
        return said + f"; digest {self.digest}, Merkle root {self.merkle_root}" * bool(self.merkle_root)


@dataclass(frozen=True)
class VerifyReport:
    """What was checked and what was counted. Rates are shares of 1; NaN without rows.

    closure_deg: the largest angle between R_C and the rigid fit of landmarks_exact.
    quick: contents were not read; then closure_deg, rate_by_subject, cells and merkle_root are empty.
    digest, merkle_root: of the rows that were read; the manifest's digest if quick; "" if there is none.
    expected: the digest or root that they must have, if the user named one.
    twins: those that there are, where there are any.
    deep: what was done about images, if it was asked for and everything else holds.
    """

    checks: tuple[Check, ...]
    heads: int = 0
    poses: int = 0
    rows: int = 0
    detected_rows: int = 0
    detection_rate: float = float("nan")
    closure_deg: float = 0.0
    rate_by_subject: dict[str, float] = field(default_factory=dict)
    cells: tuple[Cell, ...] = ()
    quick: bool = False
    digest: str = ""
    merkle_root: str = ""
    expected: str | None = None
    deep: Deep | None = None
    twins: Twins | None = None

    @property
    def ok(self) -> bool:
        """Did every check pass?"""
        return all(check.ok for check in self.checks)

    @property
    def worst_cells(self) -> list[Cell]:
        """The cells of yaw x pitch with the lowest detection rate, worst first."""
        return sorted(self.cells, key=lambda cell: cell.rate)[:WORST]

    def text(self) -> str:
        """The report for people, a line a fact."""
        unchecked = [check.name for check in self.checks if check.detail == NOT_CHECKED]
        lines = [
            f"{'ok  ' if check.ok else 'FAIL'}  {check.name}{': ' * bool(check.detail)}{check.detail}"
            for check in self.checks
            if check.detail != NOT_CHECKED
        ]
        if unchecked:
            lines.append(f"{NOT_CHECKED}: {', '.join(unchecked)}")
        if self.rows:
            lines.append(
                f"{plural(self.rows, 'row')} of {plural(self.heads, 'head')} x {plural(self.poses, 'pose')}; "
                f"a face was found in {self.detection_rate:.1%}"
            )
        if self.twins is not None:
            lines.append(self.twins.line())
        if self.quick:
            lines.append("quick: sizes and footers only; without --quick every byte is read")
        elif self.rows:
            if any(check.name == "exact landmarks" for check in self.checks):
                lines.append(f"exact landmarks give R_C back to {self.closure_deg:.1g}°")
            worst = [
                f"  yaw {cell.yaw_deg:+g}, pitch {cell.pitch_deg:+g}: {cell.rate:.0%} of {cell.rows}"
                for cell in self.worst_cells
                if cell.rate < 1
            ]
            lines += ["a face was found least often at"] * bool(worst) + worst
        if self.deep is not None:
            lines += self.deep.lines()
        if not self.quick and self.ok:
            lines += [PROVED, *self._not_proved]
        if self.digest and self.rows:
            lines.append(f"digest {self.digest}, " + self._root_text)
        return "\n".join(map(printable, lines))

    @property
    def _not_proved(self) -> list[str]:
        """What even a report without problems leaves open."""
        lines = []
        if self.deep is None or not self.deep.rendered:
            lines.append(NO_IMAGES)
        elif not (self.deep.all_rows and self.deep.complete):
            lines.append(OTHER_IMAGES)
        if self.expected != self.merkle_root:
            lines.append(NO_ORIGIN)
        return lines + [CHECKSUM] * (self.expected == self.digest)

    @property
    def _root_text(self) -> str:
        return "as the manifest says" if self.quick else f"Merkle root {self.merkle_root}"

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {
            "ok": self.ok,
            "quick": self.quick,
            "digest": self.digest,
            "merkle_root": self.merkle_root,
            "checks": [{"name": c.name, "ok": c.ok, "detail": c.detail} for c in self.checks],
            "deep": asdict(self.deep) if self.deep else None,
            **({"twins": asdict(self.twins)} if self.twins else {}),
            "heads": self.heads,
            "poses": self.poses,
            "rows": self.rows,
            "detected_rows": self.detected_rows,
            "detection_rate": self.detection_rate if self.rows else None,
            "closure_deg": self.closure_deg,
            "rate_by_subject": self.rate_by_subject,
            "cells": [{**asdict(cell), "rate": cell.rate} for cell in self.cells],
        }
