# SPDX-License-Identifier: GPL-3.0-or-later
"""What is known of parts is not read again; what is not, from the first byte to the last."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest
from fake_lane import unit_order

from generator.dataset.format.part_info import PartInfo
from generator.errors import DatasetError
from generator.execution.build import receipts as module
from generator.execution.build.receipts import RECEIPTS_FILE, Receipts, split_done
from generator.messages import BuildOrder

FOUR, THREE = (unit_order(Path("nowhere"), "a", images=images) for images in (4, 3))
"""Orders of so many images."""


class Reader:
    """Stands for check_unit: a part is as many rows as its file has bytes; "x" is damaged."""

    def __init__(self) -> None:
        self.read: list[str] = []

    def unit(self, root: Path, path: str, order: BuildOrder) -> PartInfo:
        return self(root / path)

    def __call__(self, file: Path) -> PartInfo:
        self.read.append(file.name)
        content = file.read_text()
        if "x" in content:
            raise DatasetError(f"{file}: not a readable part")
        path = "/".join(file.parts[-3:])
        return PartInfo(path, len(content), 1, len(content), "0", "0", file.stem, "neutral")


@pytest.fixture
def reader(monkeypatch: pytest.MonkeyPatch) -> Reader:
    """In the place of what reads Parquet."""
    reader = Reader()
    monkeypatch.setattr(module, "check_part", reader)
    monkeypatch.setattr(module, "check_unit", reader.unit)
    return reader


def write(root: Path, name: str, content: str = "rows") -> str:
    """A part; its path as parts are called."""
    file = root / "data" / "train" / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(content)
    return f"data/train/{name}"


def committed(root: Path, reader: Reader, *names: str) -> list[str]:
    """Parts that a build committed and noted."""
    paths = [write(root, name) for name in names]
    receipts = Receipts(root)
    for path in paths:
        receipts.add(reader(root / path), FOUR)
    reader.read.clear()
    return paths


def test_a_part_that_is_not_there(tmp_path: Path, reader: Reader) -> None:
    assert Receipts(tmp_path).valid_part("data/train/a", FOUR) is None
    [path] = committed(tmp_path, reader, "a")
    (tmp_path / path).unlink()
    assert Receipts(tmp_path).valid_part(path, FOUR) is None, "its receipt does not stand for it"


def test_what_was_noted_is_not_read_again(tmp_path: Path, reader: Reader) -> None:
    [path] = committed(tmp_path, reader, "a")
    part = Receipts(tmp_path).valid_part(path, FOUR)
    assert part == PartInfo(path, 4, 1, 4, "0", "0", "a", "neutral")
    assert not reader.read


def test_what_was_not_is_read_once(tmp_path: Path, reader: Reader) -> None:
    path = write(tmp_path, "a")
    receipts = Receipts(tmp_path)
    assert receipts.valid_part(path, FOUR) == receipts.valid_part(path, FOUR)
    assert reader.read == ["a"]


@pytest.mark.parametrize("change", ["size", "time"])
def test_what_changed_is_read_again(tmp_path: Path, reader: Reader, change: str) -> None:
    [path] = committed(tmp_path, reader, "a")
    file = tmp_path / path
    stamp = file.stat().st_mtime_ns
    if change == "size":
        file.write_text("row")
        os.utime(file, ns=(stamp, stamp))
    else:
        os.utime(file, ns=(stamp, stamp + 10**9))
    assert Receipts(tmp_path).valid_part(path, THREE if change == "size" else FOUR) is not None
    assert reader.read == ["a"]


def test_a_part_of_other_rows_or_damaged_is_none(tmp_path: Path, reader: Reader) -> None:
    assert Receipts(tmp_path).valid_part(write(tmp_path, "a"), THREE) is None
    assert Receipts(tmp_path).valid_part(write(tmp_path, "b", "x"), FOUR) is None


def test_whose_parts_they_are(tmp_path: Path, reader: Reader) -> None:
    [path] = committed(tmp_path, reader, "a")
    assert Receipts(tmp_path).head_of(path) == ("a", "neutral")
    assert not reader.read
    assert Receipts(tmp_path).head_of(write(tmp_path, "b")) == ("b", "neutral"), "without a receipt, too"
    assert Receipts(tmp_path).head_of(write(tmp_path, "c", "x")) is None


@pytest.mark.parametrize(
    "rubbish", ["", "{", "3", "null", "[]", '{"part": 1}', '{"part": {}, "stamp": []}', "\0"]
)
def test_lines_that_a_crash_left_cost_time_and_nothing_else(
    tmp_path: Path, reader: Reader, rubbish: str
) -> None:
    first, second = committed(tmp_path, reader, "a", "b")
    file = tmp_path / RECEIPTS_FILE
    lines = file.read_text().splitlines()
    file.write_text(f"{rubbish}\n{lines[0]}\n{lines[1][:-9]}")  # the last is cut short
    receipts = Receipts(tmp_path)
    assert receipts.valid_part(first, FOUR) and receipts.valid_part(second, FOUR)
    assert reader.read == ["b"]
    receipts.add(reader(tmp_path / second), FOUR)
    assert json.loads(file.read_text().splitlines()[-1])["part"]["path"] == second, "on a line of its own"


def test_orders_are_split_into_done_and_to_do(tmp_path: Path, reader: Reader) -> None:
    orders = [unit_order(tmp_path, unit, images=4) for unit in ("a", "b", "c")]
    committed(tmp_path, reader, "part-a.parquet", "part-gone.parquet")
    write(tmp_path, "part-c.parquet")
    done, todo = split_done(orders, Receipts(tmp_path))
    assert [part.path for part in done] == ["data/train/part-a.parquet", "data/train/part-c.parquet"]
    assert [order.unit for order in todo] == ["b"]
    assert reader.read == ["part-c.parquet"]
    kept = [json.loads(line)["part"]["path"] for line in (tmp_path / RECEIPTS_FILE).read_text().splitlines()]
    assert kept == [part.path for part in done], "of parts that are no longer planned nothing is kept"
    reader.read.clear()
    assert split_done(orders, Receipts(tmp_path))[0] == done
    assert not reader.read, "and nothing is read twice"
