# SPDX-License-Identifier: GPL-3.0-or-later
"""A folder for the Hugging Face hub: Parquet with images inside, and a card."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa

from generator.dataset.export.options import Format
from generator.dataset.export.readme import conventions, facts, licences
from generator.dataset.export.source import Source
from generator.dataset.export.tables import IMAGE, dtype_name, exported_schema, write_tables
from generator.dataset.format.columns import ROWS
from generator.dataset.format.heads_table import HEADS_FILE
from generator.dataset.show.card import CARD_FILE
from generator.dataset.show.column_tables import column_rows, markdown_table
from generator.words import plural

_HUB_LICENCES = {
    "CC0-1.0": "cc0-1.0",
    "CC-BY-3.0": "cc-by-3.0",
    "CC-BY-4.0": "cc-by-4.0",
    "CC-BY-SA-4.0": "cc-by-sa-4.0",
    "CC-BY-NC-4.0": "cc-by-nc-4.0",
    "MIT": "mit",
}
_SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (1_000_000, "100K<n<1M"))

_READING = """\
```python
from datasets import load_dataset
rows = load_dataset("FOLDER OR NAME ON THE HUB")
heads = load_dataset("FOLDER OR NAME ON THE HUB", "heads")
```

Landmarks as an array: `np.array(row["landmarks"]).reshape(-1, 3)`. Not with `with_format("numpy")`, which
narrows float64 to float32."""


def write(source: Source, folder: Path) -> str:
    """Write the export and its card. Raises as :func:`generator.dataset.export.tables.write_tables` does."""
    rows = write_tables(source, folder)
    (folder / CARD_FILE).write_text(card(source, rows, "huggingface"), encoding="utf-8")
    return ""


def card(source: Source, rows: Mapping[str, int], name: str) -> str:
    """README.md with the front matter of the hub. rows: of each split."""
    schema = exported_schema(source)
    columns = column_rows(ROWS.values(), source.topology, lambda column: column.name in schema.names)
    rate = sum(p.detected for p in source.parts) / sum(p.rows for p in source.parts)
    summary = (
        f"Images of {plural(len(source.heads), 'head')} with exact head pose: "
        f"{plural(source.rows, 'row')}, rendered in Blender at poses that are known, not measured. "
        f"A detector found the face in {rate:.1%} of the rows read; `detected` says in which."
    )
    sections = [
        _front_matter(source, rows, schema),
        "# Head poses",
        summary,
        facts(source, name),
        "## Licences\n\n" + licences(source),
        "## Reading\n\n" + _READING,
        "## Columns\n\n" + markdown_table(("column", "type", "meaning"), columns),
        "## Conventions\n\n" + conventions(source),
    ]
    return "\n\n".join(sections) + "\n"


def size_category(rows: int) -> str:
    """What the hub calls a dataset of so many rows."""
    return next((text for limit, text in _SIZES if rows < limit), "n>1M")


def _front_matter(source: Source, rows: Mapping[str, int], schema: pa.Schema) -> str:
    licences = {head.license for head in source.heads}
    only = licences.pop() if len(licences) == 1 else ""
    lines = ["---", "pretty_name: Head poses", f"license: {_HUB_LICENCES.get(only, 'other')}"]
    if only not in _HUB_LICENCES:
        lines.append("license_name: of-each-head-see-the-card")
    lines += [
        "task_categories: [keypoint-detection]",
        "tags: [head-pose-estimation, face-landmarks, synthetic]",
        f"size_categories: [{size_category(source.rows)}]",
        "configs:",
        "- config_name: default",
        "  default: true",
        "  data_files:",
    ]
    for split in sorted(rows):
        lines += [f"  - split: {json.dumps(split)}", f"    path: {json.dumps(f'data/{split}/*.parquet')}"]
    lines += [
        "- config_name: heads",
        f"  data_files: {HEADS_FILE}",
        "dataset_info:",
        "- config_name: default",
    ]
    lines.append("  features:")
    for field in schema:
        lines.append(f"  - name: {field.name}")
        if field.name == IMAGE:
            lines.append("    dtype: image")
        elif pa.types.is_fixed_size_list(field.type):
            # "sequence" is the older spelling of a list, which old and new versions of datasets read.
            kind = dtype_name(field.type.value_type)
            lines += [f"    sequence: {kind}", f"    length: {field.type.list_size}"]
        else:
            lines.append(f"    dtype: {dtype_name(field.type)}")
    lines.append("  splits:")
    for split, count in sorted(rows.items()):
        lines += [f"  - name: {json.dumps(split)}", f"    num_examples: {count}"]
    return "\n".join([*lines, "---"])


FORMAT = Format(
    write,
    readers="the hub",
    holds="Parquet with images inside, heads, a card",
    written="`rotation`, nine numbers",
    back="as it stands",
    public=True,
)
