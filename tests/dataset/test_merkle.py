# SPDX-License-Identifier: GPL-3.0-or-later
"""The root over rows is RFC 6962's, over sorted rows, and of one set of rows alone."""

from __future__ import annotations

import hashlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from generator.dataset.format.digest import HASH_BYTES, digest_of
from generator.dataset.format.merkle import merkle_root

HASHES = st.lists(st.binary(min_size=HASH_BYTES, max_size=HASH_BYTES), max_size=40)


def as_the_rfc_says(leaves: list[bytes]) -> bytes:
    """MTH of RFC 6962, section 2.1."""
    if not leaves:
        return hashlib.sha256(b"").digest()
    if len(leaves) == 1:
        return hashlib.sha256(b"\x00" + leaves[0]).digest()
    half = 1
    while 2 * half < len(leaves):
        half *= 2
    left, right = as_the_rfc_says(leaves[:half]), as_the_rfc_says(leaves[half:])
    return hashlib.sha256(b"\x01" + left + right).digest()


@pytest.mark.parametrize("count", [*range(18), 64, 65, 1000])
def test_it_is_the_tree_of_rfc_6962_over_sorted_hashes(count: int) -> None:
    rows = [hashlib.sha256(str(k).encode()).digest() for k in range(count)]
    assert merkle_root(rows) == as_the_rfc_says(sorted(rows)).hex()


@given(HASHES, st.randoms(use_true_random=False))
def test_neither_order_nor_pieces_matter(rows: list[bytes], random) -> None:
    """Nor do bytes of zero, of which numpy thinks little at the end of a text."""
    rows = [*rows, bytes(32), bytes(31) + b"\x01", b"\x01" + bytes(31)]
    expected = as_the_rfc_says(sorted(rows)).hex()
    assert merkle_root(random.sample(rows, len(rows))) == expected
    assert merkle_root([b"".join(rows[:3]), b"", b"".join(rows[3:])]) == expected


def test_rows_that_add_up_to_the_same_have_another_root() -> None:
    """What a sum cannot tell apart; with many hashes to choose from, such rows can be found."""
    one, two, three = (number.to_bytes(32, "big") for number in (1, 2, 3))
    zero = bytes(32)
    assert digest_of(one + two) == digest_of(zero + three)
    assert merkle_root([one, two]) != merkle_root([zero, three])


def test_no_node_passes_for_a_row_and_no_row_for_two() -> None:
    rows = [bytes([k]) * 32 for k in range(4)]
    leaves = [hashlib.sha256(b"\x00" + row).digest() for row in rows]
    nodes = [hashlib.sha256(b"\x01" + a + b).digest() for a, b in (leaves[:2], leaves[2:])]
    roots = {merkle_root(rows), merkle_root(nodes), merkle_root(leaves), merkle_root([*rows, rows[3]])}
    assert len(roots) == 4
