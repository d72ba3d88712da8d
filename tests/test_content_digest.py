# SPDX-License-Identifier: GPL-3.0-or-later
"""The digest of a dataset's content depends on its rows alone: not on their order, nor on what holds them."""

from __future__ import annotations

import hashlib
import io
import struct
from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from hypothesis import given
from hypothesis import strategies as st

from generator.dataset.format.digest import add_digests, content_digest

SCHEMA = pa.schema(
    [
        ("name", pa.string()),
        ("angle", pa.float64()),
        ("small", pa.float32()),
        ("place", pa.int16()),
        ("seen", pa.bool_()),
        ("points", pa.list_(pa.float32(), 3)),
    ]
)
SMALL = st.floats(width=32)
ROW = st.fixed_dictionaries(
    {
        "name": st.text(max_size=5),
        "angle": st.floats(),
        "small": SMALL,
        "place": st.integers(-(2**15), 2**15 - 1),
        "seen": st.booleans(),
        "points": st.lists(SMALL, min_size=3, max_size=3),
    }
)
ROWS = st.lists(ROW, max_size=8)
Rows = list[dict[str, Any]]


def digest(rows: Rows) -> str:
    """Of one table."""
    return content_digest(pa.Table.from_pylist(rows, schema=SCHEMA))


def as_documented(rows: Rows) -> str:
    """The sum of the hashes of rows, from what the module says of them and nothing of its code."""
    lines = ["angle:f8", "name:text", "place:i2", "points:f4[3]", "seen:u1", "small:f4"]
    prefix = hashlib.sha256("\n".join(lines).encode()).digest()
    total = 0
    for row in rows:
        numbers = struct.pack(
            "<dh3fBf", row["angle"], row["place"], *row["points"], row["seen"], row["small"]
        )
        text = row["name"].encode()
        whole = prefix + numbers + struct.pack("<I", len(text)) + text
        total += int.from_bytes(hashlib.sha256(whole).digest(), "big")
    return f"{total % (1 << 256):064x}"


@given(ROWS)
def test_it_is_the_sum_of_what_is_documented(rows: Rows) -> None:
    """Whoever wrote a digest down finds it again, whatever becomes of the code."""
    for row in rows:
        for name in ("angle", "small", "points"):
            values = np.nan_to_num(row[name], nan=0.5, posinf=1.0, neginf=-1.0)
            row[name] = values.tolist()
    assert digest(rows) == as_documented(rows)


def test_a_table_of_texts_alone() -> None:
    prefix = hashlib.sha256(b"a:text\nb:text").digest()
    expected = hashlib.sha256(prefix + b"\x02\0\0\0xy" + b"\0\0\0\0").hexdigest()
    assert content_digest(pa.table({"b": [""], "a": ["xy"]})) == expected


def test_digests_to_all_their_digits() -> None:
    row = {"name": "é", "angle": 0.1, "small": 0.5, "place": -2, "seen": True, "points": [1.0, 2.0, 3.0]}
    found = {digest([row] * count) for count in range(1, 9)}
    assert found == {as_documented([row] * count) for count in range(1, 9)}
    assert any(int(one[0], 16) > 7 for one in found), "the first bit, too"


@given(ROWS, st.randoms(use_true_random=False))
def test_the_order_of_rows_does_not_matter(rows: Rows, random: Any) -> None:
    shuffled = random.sample(rows, len(rows))
    assert digest(shuffled) == digest(rows)


@given(ROWS, st.lists(st.integers(0, 8), max_size=3))
def test_nor_how_they_are_cut_into_parts(rows: Rows, cuts: list[int]) -> None:
    edges = [0, *sorted(min(cut, len(rows)) for cut in cuts), len(rows)]
    parts = [rows[start:stop] for start, stop in pairwise(edges)]
    assert add_digests(map(digest, parts)) == digest(rows)
    assert add_digests(map(digest, reversed(parts))) == digest(rows)
    chunked = pa.concat_tables([pa.Table.from_pylist(part, schema=SCHEMA) for part in parts])
    assert content_digest(chunked) == digest(rows)
    batches = chunked.to_batches()
    assert add_digests(map(content_digest, batches)) == digest(rows)


@given(ROWS.filter(bool), st.sampled_from([2, 3, 1000]), st.sampled_from(["zstd", "none", "snappy"]))
def test_nor_the_file_they_are_in(rows: Rows, group: int, compression: str) -> None:
    file = io.BytesIO()
    pq.write_table(
        pa.Table.from_pylist(rows, schema=SCHEMA), file, row_group_size=group, compression=compression
    )
    assert content_digest(pq.read_table(file)) == digest(rows)


@given(ROWS, st.permutations(range(len(SCHEMA))))
def test_nor_the_order_of_columns(rows: Rows, order: list[int]) -> None:
    table = pa.Table.from_pylist(rows, schema=SCHEMA)
    assert content_digest(table.select([SCHEMA.names[k] for k in order])) == digest(rows)


@given(ROWS.filter(bool), st.sampled_from(SCHEMA.names), st.data())
def test_every_value_does_matter(rows: Rows, column: str, data: st.DataObject) -> None:
    place = data.draw(st.integers(0, len(rows) - 1))
    old = rows[place][column]
    changed = {
        "name": f"{old}x",
        "angle": 1.0 if old != 1.0 else 2.0,
        "small": 1.0 if old != 1.0 else 2.0,
        "place": old ^ 1 if column == "place" else 0,
        "seen": not old,
        "points": [*old[:2], 1.0 if old[2] != 1.0 else 2.0] if column == "points" else [],
    }[column]
    others = [*rows[:place], {**rows[place], column: changed}, *rows[place + 1 :]]
    assert digest(others) != digest(rows)


@given(ROWS.filter(bool))
def test_so_does_how_often_a_row_is_there(rows: Rows) -> None:
    assert len({digest(rows), digest([*rows, rows[0]]), digest(rows[1:])}) == 3


@given(st.text(max_size=4), st.text(max_size=4), st.text(max_size=4), st.text(max_size=4))
def test_texts_do_not_run_into_each_other(a: str, b: str, c: str, d: str) -> None:
    first, second = (pa.table({"a": [x], "b": [y]}) for x, y in ((a, b), (c, d)))
    assert (content_digest(first) == content_digest(second)) == ((a, b) == (c, d))


def test_one_nan_is_like_another() -> None:
    quiet, other = np.array([0x7FF8000000000000, 0xFFF8000000000123], dtype=np.uint64).view(np.float64)
    first, second = (pa.table({"a": pa.array(np.array([value]))}) for value in (quiet, other))
    assert (
        first.column("a").chunk(0).buffers()[1].to_pybytes()
        != second.column("a").chunk(0).buffers()[1].to_pybytes()
    )
    assert content_digest(first) == content_digest(second)


def test_names_and_types_of_columns_matter() -> None:
    ones = {"f8": np.float64, "f4": np.float32, "i2": np.int16, "b": np.bool_}
    tables = [pa.table({"a": pa.array(np.ones(1, kind))}) for kind in ones.values()]
    tables.append(pa.table({"b": pa.array(np.ones(1))}))
    assert len({content_digest(table) for table in tables}) == len(tables)


def test_nothing_at_all() -> None:
    assert digest([]) == add_digests([]) == "0" * 64
