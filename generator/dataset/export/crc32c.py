# SPDX-License-Identifier: GPL-3.0-or-later
"""CRC-32C (Castagnoli), which neither zlib nor numpy has; RFC 3720, appendix B.4.

Byte by byte in Python it takes longer than all the rest of an export. So the bytes are cut into rows of equal
length whose remainders numpy works out side by side; then these are put together, for which a remainder is
moved on by a row of zeros. That is linear, so a table for each of its four bytes does it.
"""

from __future__ import annotations

import numpy as np

_POLYNOMIAL = 0x82F63B78
_ROW = 256
"""Bytes of a row: about as many steps of numpy for all of them as of Python to put them together."""


def _byte_table() -> np.ndarray:
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, table >> 1 ^ np.uint32(_POLYNOMIAL), table >> 1).astype(np.uint32)
    return table


_TABLE = _byte_table()
_LIST = _TABLE.tolist()


def _moved(remainder: np.ndarray, zeros: int) -> np.ndarray:
    for _ in range(zeros):
        remainder = _TABLE[remainder & 0xFF] ^ remainder >> 8
    return remainder


_BYTES = np.arange(256, dtype=np.uint32)
_BY_ROW = [_moved(_BYTES << np.uint32(shift), _ROW).tolist() for shift in (0, 8, 16, 24)]
"""What a remainder becomes after a row of zeros, by each of its bytes."""


def crc32c(data: bytes) -> int:
    """The checksum, 32 bits."""
    whole = len(data) // _ROW
    rows = np.frombuffer(data, np.uint8, whole * _ROW).reshape(whole, _ROW)
    remainders = np.zeros(whole, np.uint32)
    for column in rows.T:
        remainders = _TABLE[(remainders ^ column) & 0xFF] ^ remainders >> 8
    a, b, c, d = _BY_ROW
    crc = 0xFFFFFFFF
    for remainder in remainders.tolist():
        crc = a[crc & 0xFF] ^ b[crc >> 8 & 0xFF] ^ c[crc >> 16 & 0xFF] ^ d[crc >> 24] ^ remainder
    for byte in data[whole * _ROW :]:
        crc = _LIST[(crc ^ byte) & 0xFF] ^ crc >> 8
    return crc ^ 0xFFFFFFFF
