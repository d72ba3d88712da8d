# SPDX-License-Identifier: GPL-3.0-or-later
"""One hash that stands for a set of rows, and that nobody can make another set of rows have.

The root of RFC 6962 (certificate transparency) over the sorted hashes of the rows
(:func:`generator.dataset.format.digest.row_hashes`):

    leaf      SHA-256(0x00 | row hash)
    node      SHA-256(0x01 | left | right)
    no rows   SHA-256 of nothing

with the largest power of two that is smaller than the number of leaves on the left of each node. The
hashes are sorted as bytes, so the root depends neither on the order of rows nor on the files they lie in.
Leaves and nodes begin differently, so that no node can pass for a row, nor one number of rows for another.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

import numpy as np

from generator.dataset.format.digest import HASH_BYTES

_LEAF, _NODE = b"\x00", b"\x01"


def merkle_root(hashes: Iterable[bytes]) -> str:
    """Root over rows, 64 hex digits, in 3 x HASH_BYTES of memory a row.

    hashes: row hashes in any order, each item any number of them end to end.
    """
    rows = bytearray().join(hashes)
    if not rows:
        return hashlib.sha256().hexdigest()
    np.frombuffer(rows, dtype=f"S{HASH_BYTES}").sort()  # in place
    level = _hashed(_LEAF, rows, HASH_BYTES)
    # Pairs from the left, an odd one passed on: the same tree as cutting at powers of two.
    while len(level) > HASH_BYTES:
        level = _hashed(_NODE, level, 2 * HASH_BYTES)
    return level.hex()


def _hashed(kind: bytes, data: bytearray, size: int) -> bytearray:
    """The hash of each piece of data of this size; what is left over at the end stays as it is."""
    whole = len(data) // size * size
    found = bytearray()
    for at in range(0, whole, size):
        found += hashlib.sha256(kind + data[at : at + size]).digest()
    return found + data[whole:]
