# SPDX-License-Identifier: GPL-3.0-or-later
"""One picture of rows and their twins: a line a row, first itself, then with each factor changed.

    python scripts/twin_sheet.py DATASET OUT.jpg --rows 5 --side 160

The rows nearest to the front of as many people. A frame says that no face was found.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import pyarrow.parquet as pq
from PIL import Image, ImageDraw

from generator.dataset.format.image import decode_image
from generator.dataset.format.manifest import read_manifest
from generator.dataset.format.open import image_bytes, read_samples
from generator.dataset.show.fitted import Fitted
from generator.dataset.show.pictures import INK, MISS, PAPER
from generator.plan.config import recorded_config
from generator.plan.factors import row_name

TOP, GAP = 22, 2


def chosen(dataset: Path, count: int) -> list[str]:
    """Names of rows, one a person."""
    columns = ["sample_id", "subject", "yaw_deg", "pitch_deg", "roll_deg"]
    rows = pq.read_table(dataset / "data", columns=columns, partitioning=None).to_pylist()
    rows.sort(key=lambda row: sum(row[name] ** 2 for name in columns[2:]))
    nearest = {row["subject"]: row["sample_id"] for row in reversed(rows)}
    return [nearest[subject] for subject in sorted(nearest)[:count]]


def main() -> None:
    """Read the images, lay them out."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("dataset", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--rows", type=int, default=5)
    parser.add_argument("--side", type=int, default=160)
    given = parser.parse_args()
    manifest, side = read_manifest(given.dataset), given.side
    factors = ["", *recorded_config(manifest.configuration, given.dataset).dataset.twins]
    names = chosen(given.dataset, given.rows)
    wanted = [row_name(name, factor) for name in names for factor in factors]
    rows = read_samples(given.dataset, manifest, wanted)
    sheet = Image.new("RGB", ((side + GAP) * len(factors), TOP + (side + GAP) * len(names)), PAPER)
    draw = ImageDraw.Draw(sheet)
    for column, factor in enumerate(factors):
        draw.text((column * (side + GAP) + 4, 5), factor or "row", INK)
        for line, name in enumerate(names):
            row = rows.get(row_name(name, factor))
            if row is None:
                continue
            at = (column * (side + GAP), TOP + line * (side + GAP))
            picture = decode_image(image_bytes(given.dataset, row), row["sample_id"])
            sheet.paste(Fitted.of(row["width"], row["height"], side).paste(picture, PAPER), at)
            if not row["detected"]:
                draw.rectangle((*at, at[0] + side - 1, at[1] + side - 1), outline=MISS, width=3)
    sheet.save(given.out, quality=88)


if __name__ == "__main__":
    main()
