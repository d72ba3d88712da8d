# SPDX-License-Identifier: GPL-3.0-or-later
"""Each file of a dataset, replaced by what no build writes: every command says so in one line."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hostile_command import Command
from hostile_files import DEEP, JP2, NO_FILES, png
from memory import peak_mb

from generator.dataset.format import image, parquet
from generator.dataset.format.files import file_sha256
from generator.errors import DatasetError

PART = "data/train/part-s1-0.parquet"
FILES = {
    "heads.parquet": ("verify", "verify quick", "report", "coco", "replay", "compact"),
    "manifest.json": ("verify", "verify quick", "report", "coco", "replay", "compact"),
    "config.toml": ("verify", "verify quick"),
    "anchors.parquet": ("verify",),
    "poses.csv": ("verify", "verify quick", "report"),
    "build.log": ("report",),
    PART: ("verify", "verify quick", "report", "coco", "huggingface", "compact"),
    "image": ("verify", "report", "coco", "huggingface", "biwi", "compact"),
}
"""What opens each. Upgrade has nothing to do with a dataset of this version."""


def _export(root: Path, name: str, missing: str) -> list[str | Path]:
    return ["export", root, "--format", name, "--missing", missing, "--out", root.parent / "x"]


COMMANDS: dict[str, Callable[[Path], list[str | Path]]] = {
    "verify": lambda root: ["verify", root],
    "verify quick": lambda root: ["verify", root, "--quick"],
    "report": lambda root: ["report", root],
    "coco": lambda root: [
        "export",
        root,
        "--format",
        "coco",
        "--missing",
        "exact",
        "--out",
        root.parent / "x",
    ],
    "biwi": lambda root: [
        "export",
        root,
        "--format",
        "biwi",
        "--missing",
        "keep",
        "--out",
        root.parent / "x",
    ],
    "huggingface": lambda root: [
        *("export", root, "--format", "huggingface", "--missing", "keep", "--out", root.parent / "x")
    ],
    "compact": lambda root: ["compact", root, "--out", root.parent / "x"],
    "replay": lambda root: ["replay", root, "s1/neutral/y+0_p+0_r+0"],
}
PAYLOADS: dict[str, Callable[[Path], object]] = {
    **NO_FILES,
    "brackets": lambda path: path.write_bytes(b"[" * DEEP),
    "nested": lambda path: path.write_bytes(b'{"a":' * DEEP),
    "noise": lambda path: path.write_bytes(bytes(range(256)) * 40),
    "empty": lambda path: path.touch(),
}
COPIED = {("heads.parquet", "compact"), ("image", "compact"), ("build.log", "report")}
"""What is in these files besides, is not looked at: a log may hold anything."""
DOORS = [(file, command) for file, commands in FILES.items() for command in commands]


def _spoiled(root: Path, file: str) -> Path:
    path = next((root / "images").rglob("*.png")) if file == "image" else root / file
    return path


@pytest.mark.timeout(60)
@pytest.mark.parametrize("payload", PAYLOADS)
@pytest.mark.parametrize(("file", "command_name"), DOORS)
def test_a_file_that_no_build_writes(
    file: str, command_name: str, payload: str, whole_dataset: Path, command: Command, tmp_path: Path
) -> None:
    root = Path(shutil.copytree(whole_dataset, tmp_path / "dataset"))
    path = _spoiled(root, file)
    path.unlink(missing_ok=True)
    PAYLOADS[payload](path)
    code, said = command("headturn", *COMMANDS[command_name](root))
    assert "Traceback" not in said
    if payload in NO_FILES or (file, command_name) not in COPIED:
        assert code in (1, 2, 3), said
        # Beside the stage that it was at; verify says it in its report.
        lines = [line for line in said.splitlines() if line.startswith("headturn: ")]
        assert len(lines) <= 1 and (lines or command_name.startswith("verify")), said
        assert len(said) < 1000, said
    else:
        assert code == 0


def test_a_link_to_a_device_is_not_hashed(tmp_path: Path) -> None:
    NO_FILES["endless"](tmp_path / "a")
    with pytest.raises(OSError, match="not a regular file"):
        file_sha256(tmp_path / "a")


@pytest.mark.parametrize("name", ["report", "coco", "biwi", "huggingface"])
@pytest.mark.parametrize("data", [png(20_000, 20_000), JP2, b"root:x:0:0"], ids=["bomb", "jp2", "text"])
def test_an_image_that_no_build_makes(
    name: str, data: bytes, whole_dataset: Path, command: Command, tmp_path: Path
) -> None:
    root = Path(shutil.copytree(whole_dataset, tmp_path / "dataset"))
    for path in (root / "images").rglob("*.png"):
        path.write_bytes(data)
    code, said = command("headturn", *COMMANDS[name](root))
    assert code == 1 and ("pixels" in said or "cannot be decoded" in said)
    assert ".png" in said or "the image of s1/neutral" in said


def test_a_resolution_that_a_build_takes_is_read() -> None:
    assert image.decode_image(png(4096, 4096), "it").size == (4096, 4096)
    with pytest.raises(DatasetError, match=r"it has more than 16,777,216 pixels"):
        image.image_format(png(4097, 4096), "it")


def _many_heads(root: Path, _: Path) -> None:
    table = pq.read_table(root / "heads.parquet")
    again = table.take(pa.array([0, 1] * 1_500_000))
    pq.write_table(again, root / "heads.parquet", compression="zstd")


def _many_anchors(root: Path, _: Path) -> None:
    table = pq.read_table(root / "anchors.parquet")
    again = table.take(pa.array([0, 1] * 40_000))
    pq.write_table(again, root / "anchors.parquet", compression="zstd")


def _long_text(column: str, file: str, repeats: int) -> Callable[[Path, Path], None]:
    """A text of 300 kB in every row; stored once."""

    def write(root: Path, _: Path) -> None:
        table = pa.concat_tables([pq.read_table(root / file)] * repeats)
        place = table.schema.get_field_index(column)
        text = pa.DictionaryArray.from_arrays(pa.array([0] * len(table), pa.int32()), ["x" * 300_000])
        table = table.set_column(place, table.schema.field(place).with_type(text.type), text)
        table = table.replace_schema_metadata(pq.read_schema(root / file).metadata)
        pq.write_table(table, root / file, compression="zstd", store_schema=False)

    return write


def _one_group(root: Path, _: Path) -> None:
    table = pq.read_table(root / PART)
    pq.write_table(pa.concat_tables([table] * 4000), root / PART, compression="zstd")


LARGE = {
    "3,000,000 heads": (_many_heads, "heads.parquet"),
    "80,000 anchors": (_many_anchors, "anchors.parquet"),
    "a long text of heads": (_long_text("attribution", "heads.parquet", 20_000), "heads.parquet"),
    "a long text of rows": (_long_text("split", PART, 100), PART),
    "72,000 rows in a group": (_one_group, PART),
}


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", LARGE)
@pytest.mark.parametrize("words", [["verify"], ["report"]], ids=" ".join)
def test_a_table_that_would_fill_the_memory(
    name: str, words: list[str], whole_dataset: Path, tmp_path: Path
) -> None:
    root = Path(shutil.copytree(whole_dataset, tmp_path / "dataset"))
    write, file = LARGE[name]
    write(root, tmp_path)
    code, peak, said = peak_mb("generator.cli", *words, root)
    assert code in (0, 1), said  # the report has no use for anchors
    assert "Traceback" not in said
    assert peak < 1000, f"{peak:.0f} MB"
    assert code == 0 or Path(file).name in said


@pytest.mark.slow
def test_what_unpacks_to_much_more_than_is_stored_is_known_from_the_footer(tmp_path: Path) -> None:
    path = tmp_path / "t.parquet"
    pq.write_table(pa.table({"a": pa.array([[0.0] * 50_000_000])}), path, compression="zstd")
    with pytest.raises(ValueError, match="unpack to"):
        parquet.open_parquet(path)
    pq.write_table(pa.table({"s": ["x" * 10_000_000] * 2}), path)
    with parquet.open_parquet(path) as file:
        assert parquet.batch_rows(file.metadata, 256) < 30
