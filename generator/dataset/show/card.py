# SPDX-License-Identifier: GPL-3.0-or-later
"""README.md of a dataset: what is in it, under which licences, how to read it."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from generator.dataset.format.columns import FURTHER, ROWS, columns_at, further_column
from generator.dataset.format.files import write_bytes
from generator.dataset.format.further import also_of
from generator.dataset.format.heads_table import HEADS_FILE, HeadRow, read_heads
from generator.dataset.format.manifest import Manifest
from generator.dataset.format.open import dataset_topology
from generator.dataset.format.schema import conventions
from generator.dataset.show.column_tables import column_rows, markdown_table
from generator.dataset.show.factors import factors_of
from generator.escape import markdown, markdown_code
from generator.landmarks.topology import FACE_MESH, Topology
from generator.plan.factors import FACTORS
from generator.words import plural

CARD_FILE = "README.md"

_READING = """\
```python
import pandas as pd
rows = pd.read_parquet("DIR/data")                       # all splits; DIR/data/train for one

import polars as pl
rows = pl.read_parquet("DIR/data/**/*.parquet")

import duckdb
rows = duckdb.sql("SELECT * FROM read_parquet('DIR/data/**/*.parquet', hive_partitioning=false)")

from datasets import load_dataset
rows = load_dataset("DIR")                               # heads: load_dataset("DIR", "heads")
```

Landmarks as an array: `np.stack(rows["landmarks"]).reshape(len(rows), -1, 3)`.
"""


def write_card(manifest: Manifest, root: Path) -> None:
    """Write README.md with the front matter that `load_dataset` reads; heads.parquet must be there.

    Raises DatasetError if it cannot.
    """
    text = dataset_card(manifest, read_heads(root), dataset_topology(root, manifest))
    write_bytes(root / CARD_FILE, text.encode())


def dataset_card(manifest: Manifest, heads: Sequence[HeadRow], topology: Topology = FACE_MESH) -> str:
    """The text of README.md."""
    rate = f"{manifest.detected_rows / manifest.rows:.1%}" if manifest.rows else "none"
    images = {
        "none": "not stored; image_sha256 is the hash of the image that was rendered",
        "files": "files under images/, see image_path",
        "embedded": "in the column image (bytes, path)",
    }[manifest.images]
    summary = (
        f"{plural(manifest.heads, 'head')}, {plural(manifest.rows, 'image')}, faces found in {rate} of them. "
        f"Made with Headturn {markdown(manifest.versions['headturn'])}; "
        f"content digest {markdown_code(manifest.digest)}."
    )
    other_tables = (
        "`heads.parquet` has a row a head: source, licence, file hashes, pivot, scale, camera, known "
        "problems. `poses.csv` lists the poses: of every head, or head by head where each has its own; every "
        "row is one of them."
    )
    further = (FURTHER[further_column(name)] for name in also_of(manifest))
    columns = column_rows(
        [*columns_at(ROWS, manifest.schema_version), *further],
        topology,
        lambda column: column.is_in(manifest.images),
    )
    sections = [
        _front_matter(manifest, heads),
        "# Head poses",
        summary,
        f"Images: {images}.",
        "## Licences\n\n" + licences_text(heads),
        "## Reading\n\n" + _READING.rstrip(),
        "## Columns of data/\n\n" + markdown_table(("column", "type", "meaning"), columns),
        other_tables,
        *variety_text(manifest.configuration),
        *twins_text(manifest),
        "## Conventions\n\n" + markdown_table(("what", "definition"), tuple(conventions(topology).items())),
    ]
    return "\n\n".join(sections) + "\n"


def variety_text(configuration: Mapping[str, Any]) -> list[str]:
    """What a dataset draws as a table in Markdown, if it draws anything.

    Raises UsageError as :func:`generator.dataset.show.factors.factors_of` does.
    """
    rows = [
        (
            factor.name,
            markdown_code(factor.drawn_from),
            factor.setting.info.unit,
            "head" if factor.distribution.per_head else "image",
            factor.setting.info.help,
        )
        for factor in factors_of(configuration)
    ]
    if not rows:
        return []
    table = markdown_table(("setting", "drawn from", "unit", "for every", "what it is"), rows)
    told = "What was drawn for a row is in its columns `look_…`, `camera` and `translation_mm`."
    return [f"## What varies\n\n{table}\n\n{told}"]


def twins_text(manifest: Manifest) -> list[str]:
    """What a dataset's twins are and how they are read, if it has any."""
    if not manifest.twins:
        return []
    asked = manifest.configuration.get("dataset", {}).get("twins", ())
    rows = [(factor.name, factor.meaning) for factor in FACTORS.values() if factor.name in asked]
    count, found = (sum(getattr(part, name) for part in manifest.twins) for name in ("rows", "detected"))
    told = (
        f"{count} images besides the rows, faces found in {found / count:.1%} of them: each is the twin of "
        "a row, the same head and pose with one factor changed. They lie in `twins/`, with the columns of "
        "`data/` and `twin_of` (the row's `sample_id`) and `factor`; `data/` has none of them. "
        '`load_dataset("DIR", "twins")` reads them, `headturn ablate` compares them with their rows.'
    )
    return ["## Twins\n\n" + told + "\n\n" + markdown_table(("factor", "what changes"), rows)]


def _front_matter(manifest: Manifest, heads: Sequence[HeadRow]) -> str:
    licenses = {head.license for head in heads}
    lines = [
        "---",
        f"license: {'cc0-1.0' if licenses == {'CC0-1.0'} else 'other'}",
        "tags: [head-pose-estimation, face-landmarks, synthetic]",
        "configs:",
        "- config_name: default",
        "  default: true",
        "  data_files:",
    ]
    for split in manifest.splits:
        lines += [f"  - split: {json.dumps(split)}", f"    path: {json.dumps(f'data/{split}/*.parquet')}"]
    lines += ["- config_name: heads", f"  data_files: {HEADS_FILE}"]
    if manifest.twins:
        lines += ["- config_name: twins", "  data_files:"]
        for split in sorted({part.path.split("/")[1] for part in manifest.twins}):
            lines += [
                f"  - split: {json.dumps(split)}",
                f"    path: {json.dumps(f'twins/{split}/*.parquet')}",
            ]
    lines.append("---")
    return "\n".join(lines)


def licences_text(heads: Sequence[HeadRow]) -> str:
    """Sources and licences of heads as a table in Markdown, and a warning where some may not be published."""
    counts = Counter((head.source, head.license, head.redistributable, head.attribution) for head in heads)
    rows = [
        (
            markdown(source),
            str(count),
            markdown(license_),
            "yes" if redistributable else "**no**",
            markdown(attribution),
        )
        for (source, license_, redistributable, attribution), count in sorted(counts.items())
    ]
    text = markdown_table(("source", "heads", "licence", "images may be published", "attribution"), rows)
    if not all(head.redistributable for head in heads):
        text += (
            "\n\n**Do not publish this dataset as it is**: rows with `redistributable = false` "
            "show heads whose licence forbids it."
        )
    return text
