# SPDX-License-Identifier: GPL-3.0-or-later
"""Some rows of a dataset, the same ones each time, spread over its heads."""

from __future__ import annotations

import hashlib
import random
from collections.abc import Iterator, Sequence

from generator.dataset.format.dataset_poses import DatasetPoses
from generator.dataset.format.heads_table import HeadRow
from generator.dataset.format.schema import sample_id
from generator.plan.factors import row_name
from generator.plan.twins import PlannedTwins, planned_twins


def choose_rows(
    heads: Sequence[HeadRow], poses: DatasetPoses, count: int | None, seed: int = 0
) -> Iterator[str]:
    """The names of count rows of the plan, head by head; None: of all.

    No head has two more than another, unless it has no more poses. Another seed chooses others: which
    rows are looked at is known to whoever knows the seed.
    """
    names = [f"{head.subject}/{head.expression}" for head in heads]
    if count is None:
        count = poses.rows
    for place, share in enumerate(_shares(names, poses.counts.tolist(), count, seed)):
        head, many = heads[place], int(poses.counts[place])
        # Not numpy's generator: this one gives the same in every version.
        chosen = random.Random(f"{seed}/{names[place]}").sample(range(many), share)
        for pose in sorted(chosen):
            yield sample_id(head.subject, head.expression, poses.name(place, pose))


def choose_twins(config: PlannedTwins, heads: Sequence[HeadRow], poses: DatasetPoses) -> Iterator[str]:
    """The names of all twins of the plan, head by head and factor by factor."""
    for place, head in enumerate(heads if config.dataset.twins else ()):
        angles = [(yaw, pitch, roll) for yaw, pitch, roll in poses.plan(place).angles_deg.tolist()]
        for factor, places in planned_twins(config, f"{head.subject}/{head.expression}", angles):
            for pose in places:
                yield sample_id(head.subject, head.expression, row_name(poses.name(place, pose), factor))


def _shares(names: Sequence[str], counts: Sequence[int], wanted: int, seed: int) -> list[int]:
    """How many rows of each head: as even as its poses allow, the heads that get one more drawn."""
    shares, left = [0] * len(names), min(wanted, sum(counts))
    order = sorted(
        range(len(names)), key=lambda place: hashlib.sha256(f"{seed}/{names[place]}".encode()).digest()
    )
    while left:
        order = [place for place in order if shares[place] < counts[place]]
        each = max(left // len(order), 1)
        for place in order[:left]:
            more = min(each, counts[place] - shares[place])
            shares[place] += more
            left -= more
    return shares
