# SPDX-License-Identifier: GPL-3.0-or-later
"""A format and a pass that there are not, registered in memory: nothing else has a list of them."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from generator import cli
from generator.dataset.export.options import ExportOptions, Format
from generator.dataset.export.run import export_dataset
from generator.dataset.export.source import Source
from generator.dataset.format.passes import passes_from_blender, passes_sha256, write_passes
from generator.dataset.show.format_tables import formats_table, missing_table, passes_table, rotations_table
from generator.errors import UsageError
from generator.plan.passes import OBJECT_INDEX, PAINTED, POSITION, Pass
from generator.registries import FORMATS, PASSES


def write_names(source: Source, folder: Path) -> str:
    names = [sample.sample_id for sample in source.samples()]
    (folder / "names.txt").write_text("\n".join(names))
    return "One name a line.\n"


NAMES = Format(
    write_names,
    readers="people who like lists",
    holds="`names.txt`",
    written="no rotation",
    back="from the name",
    missing=("skip", "keep"),
    images=False,
)


@pytest.fixture
def _names() -> Iterator[None]:
    FORMATS.add("names", NAMES)
    yield
    FORMATS.remove("names")


@pytest.mark.usefixtures("_names")
def test_a_new_format_is_exported_documented_and_a_choice(dataset: Path, tmp_path: Path, monkeypatch, capsys):
    done = export_dataset(dataset, "names", tmp_path / "out")
    assert (done.rows, done.left_out) == (32, 4)
    assert len((tmp_path / "out" / "names.txt").read_text().split()) == 32
    assert "One name a line." in (tmp_path / "out" / "README.md").read_text()
    assert "| `names` | people who like lists | `names.txt` |" in formats_table()
    assert "| names | no rotation | from the name |" in rotations_table()
    [skip] = [line for line in missing_table().splitlines() if line.startswith("| `skip` |")]
    assert skip.endswith("| all | names |")
    monkeypatch.setattr(
        sys, "argv", ["headturn", "export", str(dataset), "--format", "names", "--out", str(tmp_path / "b")]
    )
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert not stopped.value.code, capsys.readouterr().err
    assert "32 rows of 2 heads as names" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--format", "tape"], "--format 'tape': expected one of nlml-hpe, 300w-lp"),
        (["--format", "coco", "--landmarks", "both"], "--landmarks 'both': expected one of auto, exact"),
        (
            ["--format", "coco", "--missing", "frontal"],
            "--missing frontal: coco takes one of fail, skip, exact",
        ),
    ],
)
def test_what_is_no_choice_is_one_line(dataset: Path, tmp_path: Path, monkeypatch, capsys, options, says):
    command = ["headturn", "export", str(dataset), *options, "--out", str(tmp_path / "o")]
    monkeypatch.setattr(sys, "argv", command)
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert stopped.value.code == 2
    assert says in " ".join(capsys.readouterr().err.split())


def test_every_format_says_what_it_is() -> None:
    for name in FORMATS:
        chosen: Format = FORMATS.get(name)
        assert all((chosen.readers, chosen.holds, chosen.written, chosen.back)), name
        assert len(set(chosen.missing)) == len(chosen.missing) > 0
    with pytest.raises(UsageError, match="expected one of"):
        FORMATS.get("tape")
    assert ExportOptions().missing is None


def test_a_new_pass_is_read_from_what_blender_wrote(tmp_path: Path) -> None:
    exr = pytest.importorskip("OpenEXR")
    speed = Pass(
        "speed",
        "use_pass_vector",
        ("Vector", "Motion"),
        ("A", "B", "C"),
        (("X",), ("Y", "V"), ("Z",)),
        "how fast it goes",
        turned=True,
        empty=-1.0,
    )
    value = np.full((2, 3), 0.5, np.float32)
    index = np.array([[1, 1, 1], [1, 1, 0]], np.float32)
    blender = {"Motion.X": value, "Motion.V": 2 * value, "Motion.Z": 3 * value, "IndexOB.X": index}
    header = {"type": exr.scanlineimage, "compression": exr.NO_COMPRESSION}
    with exr.File(header, {f"ViewLayer.{name}": pixels for name, pixels in blender.items()}) as file:
        file.write(str(tmp_path / "b.exr"))
    PASSES.add("speed", speed)
    try:
        made = passes_from_blender(tmp_path / "b.exr", ["speed", "object_index"], 700.0)
        assert "| `speed` | A B C | how fast it goes |" in passes_table()
    finally:
        PASSES.remove("speed")
    assert sorted(made) == ["object_index.X", *speed.channel_names]
    for channel, expected in zip("ABC", (0.5, -1.5, 1.0), strict=True):
        np.testing.assert_array_equal(made[f"speed.{channel}"], np.where(index == 1, expected, -1.0))
    write_passes(made, tmp_path / "ours.exr")
    assert len(passes_sha256(made)) == 64
    with pytest.raises(UsageError, match="--passes 'speed': expected one of depth, normal"):
        passes_from_blender(tmp_path / "b.exr", ["speed"], 700.0)


def test_every_pass_is_whole() -> None:
    for name in PASSES:
        one: Pass = PASSES.get(name)
        assert one.name == name and one.channels and one.meaning
        if one.switch != PAINTED:
            assert len(one.axes) == len(one.channels) and one.layers
        assert not one.turned or len(one.channels) == 3
    assert POSITION.channel_names == ("position.X", "position.Y", "position.Z") and OBJECT_INDEX.empty == 0
