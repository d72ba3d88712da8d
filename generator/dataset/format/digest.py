# SPDX-License-Identifier: GPL-3.0-or-later
"""A digest of what a dataset says, whatever files it is cut into.

Each row is hashed alone and the hashes are added modulo 2^256, so the digest
does not depend on the order of rows, their distribution over parts, or the
encoding and compression of the files. A row is hashed as

    SHA-256( H | fixed columns | text columns ),   both in order of their names,

* H: SHA-256 of the lines "name:type", sorted, such as "yaw_deg:f8", "rotation:f8[9]", "subject:text";
* numbers: little-endian, IEEE 754, NaN as the quiet NaN with no payload; bool: one byte;
* lists: their elements;
* text: length in bytes as uint32, little-endian, then UTF-8.

The column "image" is left out: its bytes are covered by image_sha256, so the
digest is the same whether images are dropped or embedded.

It is a checksum. Sums of hashes can be made to meet a given one, so it finds damage and proves nothing
against somebody who means to deceive; :mod:`generator.dataset.format.merkle` makes of the same hashes
what does.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

import numpy as np
import pyarrow as pa

NO_ROWS = "0" * 64
HASH_BYTES = 32
_UNCOVERED = {"image"}


def content_digest(table: pa.Table | pa.RecordBatch) -> str:
    """Digest of all rows of a table, 64 hex digits. Raises as :func:`row_hashes` does."""
    return digest_of(row_hashes(table))


def row_hashes(table: pa.Table | pa.RecordBatch) -> bytes:
    """The hash of each row of a table, HASH_BYTES each, one after the other.

    Raises TypeError: a column is neither number, bool, text nor a fixed-size list of numbers;
    ValueError: there are nulls.
    """
    names = sorted(set(table.schema.names) - _UNCOVERED)
    fixed: list[np.ndarray] = []
    texts: list[list[bytes]] = []
    header = []
    for name in names:
        column = table.column(name)
        if column.null_count:
            raise ValueError(f"column {name} has nulls")
        if pa.types.is_string(column.type):
            header.append(f"{name}:text")
            texts.append([_text(value) for value in column.to_pylist()])
        else:
            array = _numbers(column, len(table))
            size = f"[{column.type.list_size}]" if pa.types.is_fixed_size_list(column.type) else ""
            header.append(f"{name}:{array.dtype.str.lstrip('<|')}{size}")
            fixed.append(array.view(np.uint8).reshape(len(table), array.dtype.itemsize * array.shape[1]))
    prefix = hashlib.sha256("\n".join(header).encode()).digest()
    numbers = np.concatenate(fixed, axis=1) if fixed else np.empty((len(table), 0), np.uint8)
    hashes = bytearray()
    for index, row in enumerate(numbers):
        digest = hashlib.sha256(prefix)
        digest.update(row.tobytes())
        digest.update(b"".join(text[index] for text in texts))
        hashes += digest.digest()
    return bytes(hashes)


def digest_of(hashes: bytes | bytearray) -> str:
    """Digest of rows from their :func:`row_hashes`."""
    places = range(0, len(hashes), HASH_BYTES)
    return _hex(sum(int.from_bytes(hashes[at : at + HASH_BYTES], "big") for at in places))


def add_digests(digests: Iterable[str]) -> str:
    """Digest of tables laid end to end, from their digests."""
    return _hex(sum(int(digest, 16) for digest in digests))


def _text(value: str) -> bytes:
    encoded = value.encode()
    return len(encoded).to_bytes(4, "little") + encoded


def _numbers(column: pa.Array | pa.ChunkedArray, rows: int) -> np.ndarray:
    """[rows, k] little-endian, contiguous, NaN canonical."""
    if isinstance(column, pa.ChunkedArray):
        column = column.combine_chunks()
    if pa.types.is_fixed_size_list(column.type):
        column = column.flatten()
    if pa.types.is_boolean(column.type):
        flags = column.to_numpy(zero_copy_only=False).astype(np.uint8)
        return flags.reshape(rows, -1) if rows else flags.reshape(0, 1)
    if not (pa.types.is_integer(column.type) or pa.types.is_floating(column.type)):
        raise TypeError(f"no canonical encoding for {column.type}")
    array = column.to_numpy(zero_copy_only=False)
    array = array.astype(array.dtype.newbyteorder("<"))  # a copy: NaN is rewritten below
    if array.dtype.kind == "f":
        array[np.isnan(array)] = np.nan
    return array.reshape(rows, -1) if rows else array.reshape(0, 1)


def _hex(total: int) -> str:
    return f"{total % 2**256:064x}"
