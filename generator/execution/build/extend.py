# SPDX-License-Identifier: GPL-3.0-or-later
"""When a grid grows, rows that are already there only change their place in it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from generator.dataset.format.part import read_part, write_part
from generator.execution.build.receipts import Receipts, part_path
from generator.plan.poses import ANGLES


def carry_over(orders: list[dict[str, Any]], root: Path, receipts: Receipts) -> int:
    """Rewrite the parts of units whose poses have new indices, without rendering. Returns how many.

    The part under the unit's earlier name stays; nobody needs it any more.
    Raises DatasetError if a part cannot be written.
    """
    carried = 0
    for order in orders:
        if order["earlier_unit"] is None:
            continue
        earlier = part_path({**order, "unit": order["earlier_unit"]})
        if (root / part_path(order)).exists() or not receipts.valid_part(earlier, len(order["poses"])):
            continue
        table = read_part(root / earlier)
        indices = np.array(order["indices"], dtype=np.int16)
        for axis, angle in enumerate(ANGLES):
            at = table.schema.get_field_index(f"{angle}_index")
            table = table.set_column(at, table.schema.field(at), pa.array(indices[:, axis]))
        receipts.add(write_part(table, root, order["split"], order["unit"]))
        carried += 1
    return carried


def earlier_parts(orders: list[dict[str, Any]]) -> set[str]:
    """Where the parts lie that :func:`carry_over` reads, relative to the dataset."""
    return {part_path({**order, "unit": order["earlier_unit"]}) for order in orders if order["earlier_unit"]}
