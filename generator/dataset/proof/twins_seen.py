# SPDX-License-Identifier: GPL-3.0-or-later
"""What all parts of twins together show: none missing, none twice, and what they hold."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from generator.dataset.format.dataset_poses import DatasetPoses
from generator.dataset.format.digest import add_digests
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.merkle import merkle_root
from generator.dataset.proof.part_checks import PartFindings
from generator.dataset.proof.twin_checks import TwinPlan
from generator.dataset.proof.verify_report import Twins
from generator.plan.config import BuildConfig


def has_twins(manifest: Manifest) -> bool:
    """Are there any, or should there be?"""
    asked = manifest.configuration.get("dataset", {})
    return bool(manifest.twins) or bool(isinstance(asked, dict) and asked.get("twins"))


class TwinsSeen:
    """Takes the findings of one part of twins after another."""

    def __init__(self, config: BuildConfig, heads: Sequence[HeadRow], poses: DatasetPoses) -> None:
        self._plan = TwinPlan(config, heads, poses)
        self._rows, self._digests, self._hashes = 0, list[str](), list[bytes]()

    def add(self, found: PartFindings) -> None:
        """Count what a part showed."""
        for factor, heads, poses in found.twins:
            self._plan.add(factor, heads, poses)
        if found.digest is not None:
            self._rows += found.rows
            self._digests.append(found.digest)
            self._hashes.append(found.hashes)

    def problems(self, manifest: Manifest, quick: bool) -> Iterable[str]:
        """What is wrong with all of them. quick: only their number is known."""
        if quick:
            planned = int(self._plan.planned.sum())
            return [f"{self._rows} twins, expected {planned}"] if self._rows != planned else []
        digest = [] if self._digest == manifest.twins_digest else ["their digest is not the manifest's"]
        return [*self._plan.problems(manifest.failures), *digest]

    def proved(self, quick: bool) -> Twins:
        """What there is."""
        if quick:
            return Twins(self._rows, self._plan.factors)
        return Twins(self._rows, self._plan.factors, self._digest, merkle_root(self._hashes))

    @property
    def _digest(self) -> str:
        return add_digests(self._digests)
