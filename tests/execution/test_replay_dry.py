# SPDX-License-Identifier: GPL-3.0-or-later
"""Replay without a renderer: which of the file, the hash in its row and the new image differs."""

from __future__ import annotations

import hashlib
import io
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from dry_build import DryBuild
from PIL import Image
from replaying import Lanes

from generator.dataset.format.part import read_part
from generator.errors import HeadError, UsageError, WorkerError
from generator.execution.replay import replay_sample, replay_samples

NAME = "amy/neutral/y+10_p+0_r+10"


def change(dry: DryBuild, sample_id: str, column: str, value: Any) -> None:
    """One value of one row, and nothing else."""
    for file in (dry.root / "data").rglob("*.parquet"):
        table = read_part(file)
        names = table["sample_id"].to_pylist()
        if sample_id in names:
            values = table[column].to_pylist()
            values[names.index(sample_id)] = value
            place = table.schema.get_field_index(column)
            changed = pa.array(values, table.schema.field(place).type)
            pq.write_table(table.set_column(place, table.schema.field(place), changed), file)


def grey(size: tuple[int, int] = (16, 16), mode: str = "RGB", kind: str = "png") -> bytes:
    file = io.BytesIO()
    Image.new(mode, size, {"RGB": (128, 128, 128)}.get(mode, 128)).save(file, kind)
    return file.getvalue()


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def test_the_same_says_what_was_compared(dry: DryBuild, again: Lanes) -> None:
    dry.build(dataset={"images": "files"})
    found = replay_sample(dry.root, NAME)
    assert found.same and found.decoded
    file = f"images/{NAME}.png"
    assert found.text().splitlines()[1] == f"compared: {file}, its recorded hash and the new image"


def test_nothing_is_said_of_a_file_where_there_is_none(dry: DryBuild, again: Lanes) -> None:
    dry.build(dataset={"images": "none"})
    found = replay_sample(dry.root, NAME)
    assert not found.decoded and not found.same, "nothing was rendered at the build, so the hash differs"
    assert found.differences == ("the image differs",)
    assert "no image is stored (images = none)" in found.compared


@pytest.mark.parametrize("images", ["files", "embedded"])
def test_a_changed_image_is_told_from_another_render(dry: DryBuild, again: Lanes, images: str) -> None:
    dry.build(dataset={"images": images})
    file = dry.root / "images" / f"{NAME}.png"
    where = f"images/{NAME}.png" if images == "files" else f"the embedded image of {NAME}"

    def store(content: bytes) -> None:
        if images == "files":
            file.write_bytes(content)
        else:
            change(dry, NAME, "image", {"bytes": content, "path": file.name})

    store(grey())
    [said] = replay_sample(dry.root, NAME).differences
    assert said == (
        f"{where} was changed after the build: up to 128 of 255 levels, on 100.00% of its pixels; "
        "what is rendered now has the recorded hash"
    )
    change(dry, NAME, "image_sha256", sha256(grey()))
    [said] = replay_sample(dry.root, NAME).differences
    assert said == "the image differs: up to 128 of 255 levels, on 100.00% of its pixels"
    change(dry, NAME, "image_sha256", "0" * 64)
    [said] = replay_sample(dry.root, NAME).differences
    assert said.startswith(f"{where} has not the hash in its row, and what is rendered now has neither's")


def test_a_changed_hash_is_told_from_a_changed_image(dry: DryBuild, again: Lanes) -> None:
    dry.build(dataset={"images": "files"})
    change(dry, NAME, "image_sha256", "0" * 64)
    found = replay_sample(dry.root, NAME)
    assert found.differences == (
        f"images/{NAME}.png is what is rendered now; the hash in its row is not its own and was changed",
    )


def test_what_is_no_image_of_its_row(dry: DryBuild, again: Lanes) -> None:
    """Even if the hash in the row is its own."""
    dry.build(dataset={"images": "files"})
    for content, says in ((b"", "is no PNG that can be decoded"), (grey(mode="L"), "has the channels L")):
        (dry.root / "images" / f"{NAME}.png").write_bytes(content)
        found = replay_sample(dry.root, NAME)
        assert not found.same and not found.decoded
        assert found.differences[0].startswith(f"images/{NAME}.png {says}")
        assert "has not the hash" in found.differences[1] or "was changed after" in found.differences[1]
        change(dry, NAME, "image_sha256", sha256(content))
        first, second = replay_sample(dry.root, NAME).differences
        assert first.startswith(f"images/{NAME}.png {says}") and second.startswith("the image differs")


def test_a_missing_image_is_a_line(dry: DryBuild, again: Lanes) -> None:
    dry.build(dataset={"images": "files"})
    (dry.root / "images" / f"{NAME}.png").unlink()
    found = replay_sample(dry.root, NAME)
    assert not found.same
    [said] = found.differences
    assert f"{NAME}.png: cannot be read (No such file or directory)" in said


def test_many_samples_go_through_the_same_lanes(
    dry: DryBuild, again: Lanes, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("generator.execution.replay.WINDOW", 5)
    monkeypatch.setattr("generator.execution.replay.VIEWS", 2)
    dry.build(dataset={"images": "files"})
    names = [row["sample_id"] for row in dry.rows]
    images = []
    found = list(replay_samples(dry.root, [*names, "x/y/z"], on_image=lambda: images.append(1)))
    assert [replay.sample_id for replay in found] == names
    assert all(replay.same for replay in found)
    assert again.opened == 1 and len(images) == 12
    assert [len(order.views) for order in again.lanes.built] == [2, 2, 1, 1, 2, 2, 2]
    assert not [*again.scratch.iterdir()], "what was rendered again is gone"


def test_one_head_that_is_gone_does_not_stop_the_others(dry: DryBuild, again: Lanes) -> None:
    dry.build(dataset={"images": "files"})
    mesh = dry.heads / "amy" / "neutral.obj"
    mesh.write_text(mesh.read_text() + "# touched\n")
    (dry.root / "images" / f"{NAME}.png").write_bytes(b"rubbish")
    found = {
        replay.sample_id: replay for replay in replay_samples(dry.root, [r["sample_id"] for r in dry.rows])
    }
    amy = [replay for name, replay in found.items() if name.startswith("amy/")]
    bob = [replay for name, replay in found.items() if name.startswith("bob/")]
    assert len(bob) == 6 and all(replay.same for replay in bob)
    assert len(amy) == 6 and all("neutral.obj: was changed" in str(r.not_rendered) for r in amy)
    assert not any(replay.same for replay in amy), "they were not rendered"
    assert "is no PNG" in found[NAME].differences[0], "their images were looked at all the same"
    with pytest.raises(HeadError, match="was changed after the build"):
        replay_sample(dry.root, NAME)


def test_a_row_that_cannot_be_rendered_and_a_place_without_blender(dry: DryBuild, again: Lanes) -> None:
    dry.build(dataset={"images": "files"})

    def broken(order: object) -> None:
        if getattr(order, "head", None) is not None and order.head.subject == "amy":  # type: ignore[attr-defined]
            raise WorkerError("out of light")

    again.lanes.before = broken  # type: ignore[method-assign]
    found = list(replay_samples(dry.root, [r["sample_id"] for r in dry.rows]))
    assert [replay.same for replay in found] == [False] * 6 + [True] * 6
    assert "amy/neutral: cannot be rendered again: out of light" in str(found[0].not_rendered)
    again.refused = UsageError("bpy is not installed")
    found = list(replay_samples(dry.root, [r["sample_id"] for r in dry.rows]))
    assert all(replay.decoded and replay.not_rendered is again.refused for replay in found)
    with pytest.raises(UsageError, match="bpy is not installed"):
        replay_sample(dry.root, NAME)
