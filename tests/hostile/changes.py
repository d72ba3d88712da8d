# SPDX-License-Identifier: GPL-3.0-or-later
"""What a stranger may do to a dataset before he gives it away. All hashes are made to agree."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from generator.dataset.format.manifest import Manifest, read_manifest, write_manifest
from generator.dataset.format.part import check_part

SECRET = "the private key of somebody"

Change = Callable[[Path, Path], None]
"""(dataset, a folder outside of it that holds secret.txt and is nobody's business)."""

NOT_NAMES = {
    "parent": "../../../../outside/evil",
    "parent and back": "a/../../../../../outside/evil",
    "absolute": "{outside}/evil",
    "dots": "..",
    "a path": "a/b",
    "backslashes": "..\\..\\evil",
    "a drive": "C:evil",
    "a device": "nul",
    "a line": "a\nb",
    "escape": "\x1b[2Ja",
    "nothing": "",
    "long": "a" * 300,
    "long in bytes": "\U0001d538" * 90,
    "zero": "a\0b",
}
"""What no subject, expression or split can be called."""

A_FEW = ("parent", "absolute", "escape", "nothing")
"""Of these, for the columns that go through the same check."""


def _names(column: str, value: str, everywhere: bool) -> Change:
    """The column of every row, and of heads.parquet and poses.csv where it is there, says value."""

    def change(root: Path, outside: Path) -> None:
        text = value.format(outside=outside)
        manifest = read_manifest(root)
        first = manifest.parts[0].subject
        for part in manifest.parts:
            if part.subject == first:
                _set(root / part.path, column, lambda old: [text] * len(old))
        if everywhere:
            heads = root / "heads.parquet"
            _set(heads, column, lambda old: [text, *old[1:]])
        _honest(root, manifest)

    return change


def _paths(column: str, path: str) -> Change:
    """The path of every row of the first head."""

    def change(root: Path, outside: Path) -> None:
        manifest = read_manifest(root)
        text = path.format(outside=outside)
        for part in manifest.parts:
            _set(root / part.path, column, lambda old: [text] * len(old))
        _honest(root, manifest)

    return change


def _linked(name: str, target: str) -> Change:
    """Something of the dataset is a link to where the same things lie, or to the secret."""

    def change(root: Path, outside: Path) -> None:
        path = next(root.glob(name))
        if target == "moved":
            moved = outside / path.name
            path.rename(moved)
            path.symlink_to(moved)
        else:
            path.unlink()
            path.symlink_to(target.format(outside=outside))

    return change


def _set(file: Path, column: str, values: Callable[[list[str]], list[str]]) -> None:
    table = pq.read_table(file, partitioning=None)
    at = table.schema.get_field_index(column)
    new = pa.array(values(table[column].to_pylist()), table.schema.field(at).type)
    pq.write_table(table.set_column(at, table.schema.field(at), new), file)


def _honest(root: Path, manifest: Manifest) -> None:
    parts = tuple(check_part(root / part.path) for part in manifest.parts)
    # What the manifest says of names is made to fit what a manifest may say.
    parts = tuple(replace(part, subject="", expression="") for part in parts)
    write_manifest(replace(manifest, parts=parts), root)


NAMES: dict[str, Change] = {
    f"{column}: {what}": _names(column, value, everywhere=column != "sample_id")
    for column in ("subject", "expression", "split", "sample_id")
    for what, value in NOT_NAMES.items()
    if column == "subject" or what in A_FEW
}

PATHS: dict[str, Change] = {
    f"{column}: {what}": _paths(column, value)
    for column in ("image_path", "passes_path")
    for what, value in {
        "parent": "../outside/secret.txt",
        "absolute": "{outside}/secret.txt",
        "parent inside": "images/../../outside/secret.txt",
        "backslashes": "..\\outside\\secret.txt",
        "endless": "/dev/zero",
    }.items()
}

LINKS: dict[str, Change] = {
    "all images": _linked("images", "moved"),
    "a head's images": _linked("images/s1", "moved"),
    "an image": _linked("images/s1/neutral/*.png", "{outside}/secret.txt"),
    "an endless image": _linked("images/s1/neutral/*.png", "/dev/zero"),
    "all parts": _linked("data", "moved"),
    "the parts of a split": _linked("data/train", "moved"),
    "a part": _linked("data/train/*.parquet", "moved"),
    "the heads": _linked("heads.parquet", "moved"),
    "the anchors": _linked("anchors.parquet", "moved"),
    "the poses": _linked("poses.csv", "moved"),
    "the manifest": _linked("manifest.json", "moved"),
}
