# SPDX-License-Identifier: GPL-3.0-or-later
"""What a dataset of a stranger says about names and files, checked before anything is done with it.

Every reader goes through here: text of a row that becomes the name of a file is a
:data:`generator.names.Name` or an :data:`generator.names.InsidePath`, and no file of a dataset is
opened through a link that leaves its folder.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc

from generator.dataset.format.columns import EVERY
from generator.errors import DatasetError
from generator.escape import quoted
from generator.names import as_inside_path, as_name, inside

_as_name = lru_cache(maxsize=2**16)(as_name)
"""The same poses come back with every head."""


def check_texts(batch: pa.RecordBatch | pa.Table, where: object) -> None:
    """Raises DatasetError, naming where, unless what may become a file's name can be one.

    Looks at the columns that are there; see ``guard`` of :class:`generator.dataset.format.columns.Column`.
    """
    for name in batch.schema.names:
        guard = EVERY[name].guard if name in EVERY else None
        if guard is None:
            continue
        column = batch.column(name)
        if not pa.types.is_string(column.type):
            raise DatasetError(f"{where}: {name} is {column.type}, no text")
        if guard == "path" and EVERY[name].default == "":
            column = pc.filter(column, pc.not_equal(column, ""))
        texts = pc.list_flatten(pc.split_pattern(column, "/")) if guard == "path" else column
        _check(name, pc.unique(texts).to_pylist(), where)


def check_head_texts(heads: Iterable[tuple[str, str, str]], where: object) -> None:
    """The same for (subject, expression, split) of a table of heads."""
    for values in heads:
        for what, text in zip(("subject", "expression", "split"), values, strict=True):
            _check(what, [text], where)


def dataset_file(root: Path, path: str) -> Path:
    """The file at path, relative to the dataset root.

    Raises DatasetError: the path or a link leads out of the dataset.
    """
    try:
        return inside(root, as_inside_path(path))
    except ValueError as error:
        raise DatasetError(
            f"{root}: the file {quoted(path)} {error}; nothing outside of a dataset is read or written"
        ) from error


def _check(what: str, texts: Iterable[str], where: object) -> None:
    for text in texts:
        try:
            _as_name(text)
        except ValueError as error:
            raise DatasetError(
                f"{where}: {what} {quoted(str(text))} {error}; this dataset was made or changed by something "
                "else than Headturn"
            ) from error
