# SPDX-License-Identifier: GPL-3.0-or-later
"""The anchors that heads of one topology share: found on the first of a source, kept in the dataset."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from generator.execution.build.placed_heads import PlacedHeads
from generator.execution.executors.executor import Executor
from generator.execution.status import Reporter
from generator.landmarks.shared import SharedAnchors
from generator.messages import Placed, PlaceOrder, Shared, ShareOrder, expect
from generator.placing.sharing import FEWEST

FIRST = 12
"""Subjects that are looked at one by one. The error of a mean over them is a third of one's."""


def find_shared(
    orders: Sequence[PlaceOrder], kept: PlacedHeads, executor: Executor, reporter: Reporter
) -> tuple[SharedAnchors, ...]:
    """Anchors of topologies that two or more of the first subjects have in common, and those kept before.

    orders: of all subjects, in their order. What was kept stays: heads that come later are given the same.
    """
    if not orders:
        return ()
    landmarks = orders[0].landmarks
    known = kept.shared(landmarks)
    if len(orders) < FEWEST:
        return known
    # Their neutral heads, as they will be placed if nothing is shared; the old zero tells nothing of the new.
    frame = {"canonical": "source"}
    first = [
        replace(order, heads=order.heads[:1], frame=frame.get(order.frame, order.frame), shared=known)
        for order in orders[:FIRST]
    ]
    reporter.stage("looking at the first heads", len(first))
    found: dict[str, Placed] = {}
    for outcome in kept.outcomes(first, executor):
        reporter.advance()
        if outcome.receipt is not None:
            found[expect(PlaceOrder, outcome.order).heads[0].name] = expect(Placed, outcome.receipt)
    alone = [(order.heads[0], placed) for order in first if (placed := found.get(order.heads[0].name))]
    alone = [
        (head, placed)
        for head, placed in alone
        if (anchors := placed.facts[0].anchors) is not None and anchors.views and anchors.way == "head"
    ]
    if len(alone) < FEWEST:
        return known
    share = ShareOrder(tuple(head for head, _ in alone), tuple(placed for _, placed in alone), landmarks)
    [outcome] = executor.run([share], lambda: None)
    if outcome.receipt is None:
        reporter.note(f"every head is looked at for itself: {outcome.error}")
        return known
    new = expect(Shared, outcome.receipt)
    if new.anchors:
        kept.keep_shared(new, landmarks)
        heads = sum(shared.heads for shared in new.anchors)
        reporter.note(
            f"landmarks of {heads} heads with the same triangles were averaged, and are those of all heads "
            "that have them"
        )
    return (*known, *new.anchors)
