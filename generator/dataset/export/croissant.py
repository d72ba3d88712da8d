# SPDX-License-Identifier: GPL-3.0-or-later
"""Croissant 1.0: the same folder as huggingface, described in JSON-LD."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pyarrow as pa

from generator.dataset.export.huggingface import card
from generator.dataset.export.options import Format
from generator.dataset.export.source import Source
from generator.dataset.export.tables import IMAGE, exported_schema, write_tables
from generator.dataset.format.columns import ROWS as COLUMNS
from generator.dataset.show.card import CARD_FILE
from generator.words import plural

CROISSANT_FILE = "croissant.json"
FILES, ROWS = "parts", "rows"
_PARQUET = "application/x-parquet"

_URLS = {
    "CC0-1.0": "https://creativecommons.org/publicdomain/zero/1.0/",
    "CC-BY-3.0": "https://creativecommons.org/licenses/by/3.0/",
    "CC-BY-4.0": "https://creativecommons.org/licenses/by/4.0/",
}

# The context of the Croissant 1.0 specification.
_CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "citeAs": "cr:citeAs",
    "column": "cr:column",
    "conformsTo": "dct:conformsTo",
    "cr": "http://mlcommons.org/croissant/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "dct": "http://purl.org/dc/terms/",
    "equivalentProperty": "cr:equivalentProperty",
    "examples": {"@id": "cr:examples", "@type": "@json"},
    "extract": "cr:extract",
    "field": "cr:field",
    "fileProperty": "cr:fileProperty",
    "fileObject": "cr:fileObject",
    "fileSet": "cr:fileSet",
    "format": "cr:format",
    "includes": "cr:includes",
    "isLiveDataset": "cr:isLiveDataset",
    "jsonPath": "cr:jsonPath",
    "key": "cr:key",
    "md5": "cr:md5",
    "parentField": "cr:parentField",
    "path": "cr:path",
    "recordSet": "cr:recordSet",
    "references": "cr:references",
    "regex": "cr:regex",
    "repeated": "cr:repeated",
    "replace": "cr:replace",
    "samplingRate": "cr:samplingRate",
    "sc": "https://schema.org/",
    "separator": "cr:separator",
    "source": "cr:source",
    "subField": "cr:subField",
    "transform": "cr:transform",
}


def write(source: Source, folder: Path) -> str:
    """Write the export and its description. Raises as :func:`...tables.write_tables` does."""
    rows = write_tables(source, folder)
    (folder / CARD_FILE).write_text(card(source, rows, "croissant"), encoding="utf-8")
    text = json.dumps(description(source), indent=1)
    (folder / CROISSANT_FILE).write_text(text + "\n", encoding="utf-8")
    return ""


def description(source: Source) -> dict[str, Any]:
    """The content of croissant.json."""
    licences = sorted({head.license for head in source.heads})
    schema = exported_schema(source)
    meanings = {name: column.meaning for name, column in COLUMNS.items()}
    attributions = dict.fromkeys(" ".join(h.attribution.split()) for h in source.heads if h.attribution)
    publishable = sum(head.redistributable for head in source.heads)
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": "http://mlcommons.org/croissant/1.0",
        "name": "head-poses",
        "description": (
            f"{plural(source.rows, 'image')} of {plural(len(source.heads), 'head')} with exact head pose, "
            f"rendered in Blender. {publishable} of the heads may be published under their licence. "
            "Columns, signs and frames: README.md."
        ),
        "license": [_URLS.get(licence) or _named(licence) for licence in licences],
        "version": source.manifest.versions["headturn"],
        "citeAs": "; ".join(attributions) or "see README.md",
        "identifier": source.manifest.digest,
        "keywords": ["head pose", "face landmarks", "synthetic"],
        "distribution": [
            {
                "@type": "cr:FileSet",
                "@id": FILES,
                "name": FILES,
                "description": "the rows, a folder a split",
                "encodingFormat": _PARQUET,
                "includes": "data/*/*.parquet",
            }
        ],
        "recordSet": [
            {
                "@type": "cr:RecordSet",
                "@id": ROWS,
                "name": ROWS,
                "description": "one row an image",
                "key": {"@id": f"{ROWS}/sample_id"},
                "field": [_field(field, meanings.get(field.name, field.name)) for field in schema],
            }
        ],
    }


def _named(licence: str) -> str:
    """A licence without an address that we know, so that no catalogue makes a link of it that is none."""
    return licence if ":" not in licence or licence.startswith("https://") else f"see README.md ({licence})"


def _field(field: pa.Field, meaning: str) -> dict[str, Any]:
    listed = pa.types.is_fixed_size_list(field.type)
    image = field.name == IMAGE
    kind = field.type.value_type if listed else field.type
    described: dict[str, Any] = {
        "@type": "cr:Field",
        "@id": f"{ROWS}/{field.name}",
        "name": field.name,
        "description": meaning,
        "dataType": "sc:ImageObject" if image else _data_type(kind),
        "source": {"fileSet": {"@id": FILES}, "extract": {"column": field.name}},
    }
    if listed:
        described["repeated"] = True
    if image:
        described["source"]["transform"] = {"jsonPath": "bytes"}
    return described


def _data_type(kind: pa.DataType) -> str:
    if pa.types.is_boolean(kind):
        return "sc:Boolean"
    if pa.types.is_integer(kind):
        return "sc:Integer"
    return "sc:Float" if pa.types.is_floating(kind) else "sc:Text"


FORMAT = Format(
    write,
    readers="machine-readable catalogues",
    holds="the same and `croissant.json` (Croissant 1.0)",
    written="`rotation`, nine numbers",
    back="as it stands",
    public=True,
)
