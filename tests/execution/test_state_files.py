# SPDX-License-Identifier: GPL-3.0-or-later
"""What lies in the folder of an unfinished build is not believed: it is held against what it is about."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from dry_build import DryBuild
from no_renderer import NoRenderer

from generator.codec import from_plain, to_plain
from generator.dataset.format.manifest import MANIFEST_FILE, read_manifest
from generator.dataset.proof.verify import verify_dataset
from generator.errors import DatasetError
from generator.execution.build.placed_heads import PLACED_FILE
from generator.execution.build.receipts import RECEIPTS_FILE
from generator.execution.lanes.options import OnImage
from generator.geometry.rotation import CAMERA_FROM_GRAPHICS, graphics_rotation, rotation_from_angles
from generator.heads.placement import Placement
from generator.heads.units import BY_EYES
from generator.landmarks.anchors import Anchors
from generator.landmarks.facing import facing
from generator.landmarks.topology import FACE_MESH
from generator.messages import HeadFacts, LaneOrder, Placed, PlaceOrder, Receipt
from generator.sealed import SEAL, sealed_line, unsealed

FILES = {"images": "files", "unit_size": 4}
CANONICAL = {"frame": "canonical"}


class Levelled(NoRenderer):
    """Finds on every head the mean face, turned by 12 degrees in its own axes."""

    def _receipt(self, order: LaneOrder, on_image: OnImage) -> Receipt:
        if not isinstance(order, PlaceOrder):
            return super()._receipt(order, on_image)
        self.placed.append(order)
        turned = rotation_from_angles(np.array([12.0, 3.0, -2.0]))
        points = FACE_MESH.surface_face() @ CAMERA_FROM_GRAPHICS @ turned.T
        found = facing(points, FACE_MESH)
        assert found is not None
        placement = Placement("mm", 1.0, "+Y", "+Z", (0.0, 0.0, 0.0), 120.0, 90.0, frame=order.frame)
        placement = replace(
            placement,
            correction=tuple(np.round(graphics_rotation(found.T), 9).reshape(-1).tolist()),
            correction_sd_deg=(0.3, 3.2, 0.1),
        )
        weights = np.full((len(points), 3), [0.25, 0.25, 0.5])
        anchors = Anchors(np.zeros(len(points), np.int32), weights, points, views=14)
        return Placed(placement, tuple(HeadFacts(3, 1, (), anchors) for _ in order.heads))


def edited(file: Path, change: Callable[[dict[str, Any]], None], *, seal: bool, line: int = 0) -> None:
    """A record of a file of sealed lines changed; seal: by somebody who knows about checksums."""
    lines = file.read_text().splitlines()
    record = unsealed(json.loads(lines[line]))
    change(record)
    stale = {**record, SEAL: json.loads(lines[line])[SEAL]}
    lines[line] = sealed_line(record) if seal else json.dumps(stale)
    file.write_text("\n".join(lines) + "\n")


def turn_the_correction(record: dict[str, Any]) -> None:
    """20 degrees more of yaw."""
    placement = record["receipt"]["placement"]
    more = graphics_rotation(rotation_from_angles(np.array([20.0, 0, 0])))
    placement["correction"] = (more @ np.reshape(placement["correction"], (3, 3))).reshape(-1).tolist()


def stretch_the_correction(record: dict[str, Any]) -> None:
    record["receipt"]["placement"]["correction"][0] += 1e-3


def forget_the_levelling(record: dict[str, Any]) -> None:
    placement = record["receipt"]["placement"]
    placement["correction"] = np.eye(3).reshape(-1).tolist()
    placement["correction_sd_deg"] = [float("nan")] * 3


def make_it_larger(record: dict[str, Any]) -> None:
    record["receipt"]["placement"]["mm_per_unit"] = 1.5


def lie_down(record: dict[str, Any]) -> None:
    record["receipt"]["placement"]["up"] = record["receipt"]["placement"]["forward"]


def lose_a_head(record: dict[str, Any]) -> None:
    record["receipt"]["facts"] = []


def weigh_otherwise(record: dict[str, Any]) -> None:
    record["receipt"]["facts"][0]["anchors"]["weights"] = to_plain(np.full((468, 3), 0.4))


@pytest.mark.parametrize("seal", [False, True], ids=["flipped", "forged"])
@pytest.mark.parametrize(
    "change",
    [
        turn_the_correction,
        stretch_the_correction,
        forget_the_levelling,
        make_it_larger,
        lie_down,
        lose_a_head,
        weigh_otherwise,
    ],
)
def test_what_was_noted_about_a_head_is_held_against_its_anchors(
    dry: DryBuild, change: Callable[[dict[str, Any]], None], seal: bool
) -> None:
    dry.build(poses=CANONICAL, lanes=Levelled())
    digest = dry.digest
    shutil.rmtree(dry.root / "data")
    (dry.root / MANIFEST_FILE).unlink()
    edited(dry.root / PLACED_FILE, change, seal=seal, line=-1)  # the first ones were of the first look
    lanes = Levelled()
    dry.build(poses=CANONICAL, lanes=lanes)
    assert len(lanes.placed) == 1, "that subject is looked at again, the other is not"
    assert dry.digest == digest
    dry.check()
    again = Levelled()
    dry.build(poses=CANONICAL, lanes=again)
    assert not again.placed, "and what was found then is kept"


class InNoUnit(Levelled):
    """Scales every head by its eyes."""

    def _receipt(self, order: LaneOrder, on_image: OnImage) -> Receipt:
        receipt = super()._receipt(order, on_image)
        if isinstance(receipt, Placed):
            scaled = replace(receipt.placement, units=BY_EYES, mm_per_unit=37.5)
            receipt = replace(receipt, placement=scaled)
        return receipt


def test_heads_in_no_unit_are_not_looked_at_again(dry: DryBuild) -> None:
    dry.build(lanes=InNoUnit())
    again = InNoUnit()
    dry.build(lanes=again)
    assert not again.placed and not again.built


class Lying(Levelled):
    """Turns every head by 20 degrees, which no label shows."""

    def _receipt(self, order: LaneOrder, on_image: OnImage) -> Receipt:
        receipt = super()._receipt(order, on_image)
        if not isinstance(receipt, Placed):
            return receipt
        record = {"receipt": to_plain(receipt)}
        turn_the_correction(record)
        return from_plain(Placed, record["receipt"])


def test_verify_holds_pose_zero_against_the_anchors(dry: DryBuild) -> None:
    dry.build(poses=CANONICAL, lanes=Lying())
    report = verify_dataset(dry.root)
    assert "amy: its correction is 20 degrees from what its anchors say" in report.text()
    assert not verify_dataset(dry.root, quick=True).ok
    dry.build(poses=CANONICAL, lanes=Levelled(), confirm=lambda what: True)
    assert "20 degrees" not in verify_dataset(dry.root).text(), "another build finds the heads as they are"
    dry.check()


def test_a_flipped_receipt_costs_reading_its_part(dry: DryBuild) -> None:
    dry.build()
    digest = dry.digest

    def claim_another_subject(record: dict[str, Any]) -> None:
        record["part"]["subject"] = "zoe"

    edited(dry.root / RECEIPTS_FILE, claim_another_subject, seal=False)
    dry.build()
    assert not dry.rendered
    assert dry.digest == digest and {part.subject for part in read_manifest(dry.root).parts} == {"amy", "bob"}
    dry.check()


def test_a_forged_receipt_is_found_by_verify_and_by_exports(dry: DryBuild) -> None:
    from generator.dataset.export.run import export_dataset

    dry.build(dataset=FILES)

    def claim_another_subject(record: dict[str, Any]) -> None:
        record["part"]["subject"] = "zoe"

    edited(dry.root / RECEIPTS_FILE, claim_another_subject, seal=True)
    dry.build(dataset=FILES)
    for quick in (True, False):
        assert "is not of zoe" in verify_dataset(dry.root, quick=quick).text()
    with pytest.raises(DatasetError, match="is not of zoe, as the manifest says; nothing was exported"):
        export_dataset(dry.root, "huggingface", dry.root.parent / "out")


def flip(file: Path, at: int = -20) -> None:
    content = bytearray(file.read_bytes())
    content[at] ^= 1
    file.write_bytes(content)


@pytest.mark.parametrize("receipts", [True, False], ids=["with receipts", "without"])
@pytest.mark.parametrize("damage", ["deleted", "flipped", "emptied", "all deleted"])
def test_pictures_are_repaired(dry: DryBuild, damage: str, receipts: bool) -> None:
    dry.build(dataset=FILES)
    digest = dry.digest
    picture = sorted((dry.root / "images" / "amy").rglob("*.png"))[1]
    if damage == "deleted":
        picture.unlink()
    elif damage == "flipped":
        flip(picture)
    elif damage == "emptied":
        picture.write_bytes(b"")
    else:
        shutil.rmtree(dry.root / "images")
    if not receipts:
        (dry.root / RECEIPTS_FILE).unlink()
    dry.build(dataset=FILES)
    assert dry.digest == digest
    if damage == "all deleted":
        assert len(dry.rendered) == 12
    else:
        assert 0 < len(dry.rendered) <= 4, "one unit"
        assert any("rendered again: data/" in note for note in dry.said.notes)
    dry.check()
    dry.build(dataset=FILES)
    assert not dry.rendered


def test_pictures_that_were_only_touched_are_read_and_stay(dry: DryBuild) -> None:
    dry.build(dataset=FILES)
    for picture in (dry.root / "images").rglob("*.png"):
        picture.touch()
    dry.build(dataset=FILES)
    assert not dry.rendered
    dry.check()


@pytest.mark.parametrize("of", ["another head", "other poses", "another configuration", "no receipts"])
def test_a_part_of_another_dataset_with_as_many_rows_is_not_taken(dry: DryBuild, of: str) -> None:
    dry.build()
    digest = dry.digest
    other = DryBuild(dry.root.parent / "other", "amy", "bob")
    if of == "other poses":
        other.build(poses={"yaw": [0, 40, 20]})
    elif of == "another configuration":
        other.build(render={"resolution": 32})
    else:
        other.build(lanes=Levelled() if of == "another head" else None)
    mine, theirs = (
        next(p for p in read_manifest(d.root).parts if p.subject == "amy" and p.rows == 4)
        for d in (dry, other)
    )
    if of == "no receipts":
        theirs = next(p for p in read_manifest(other.root).parts if p.subject == "bob" and p.rows == 4)
        (dry.root / RECEIPTS_FILE).unlink()
    shutil.copy(other.root / theirs.path, dry.root / mine.path)
    dry.build()
    assert len(dry.rendered) == 4
    assert dry.digest == digest
    dry.check()


@pytest.mark.parametrize("name", ["config.toml", "failures.jsonl", "heads.parquet", "poses.csv"])
def test_the_manifest_vouches_for_the_files_beside_it(dry: DryBuild, name: str) -> None:
    dry.build()
    file = dry.root / name
    if file.exists():
        flip(file)
    else:
        file.write_text("{}\n")
    report = verify_dataset(dry.root)
    assert not report.ok and name in report.text()


@pytest.mark.parametrize("place", np.linspace(0, 0.9999, 40).tolist())
def test_a_flipped_bit_in_the_manifest_is_said(dry: DryBuild, place: float) -> None:
    dry.build()
    file = dry.root / MANIFEST_FILE
    before = file.read_bytes()
    content = bytearray(before)
    content[int(place * len(content))] ^= 1
    file.write_bytes(content)
    try:
        now = read_manifest(dry.root)
    except DatasetError as error:
        assert "manifest.json" in str(error) and "\n" not in str(error)
    else:
        assert json.loads(bytes(content)) == json.loads(before), "blanks"
        assert now.digest == json.loads(before)["digest"]


def test_a_link_out_of_the_dataset_is_not_built_through(dry: DryBuild) -> None:
    dry.build(dataset=FILES)
    elsewhere = dry.root.parent / "elsewhere"
    (dry.root / "images").rename(elsewhere)
    (dry.root / "images").symlink_to(elsewhere)
    before = sorted(elsewhere.rglob("*"))
    with pytest.raises(DatasetError, match="images' is a link out of the folder"):
        dry.build(dataset=FILES, fresh=True, confirm=lambda what: True)
    assert sorted(elsewhere.rglob("*")) == before


@pytest.mark.parametrize("receipts", [True, False], ids=["with receipts", "without"])
@pytest.mark.parametrize("change", ["a column by another name", "another value"])
def test_a_part_that_was_written_anew_is_not_taken(dry: DryBuild, change: str, receipts: bool) -> None:
    """What a flipped bit of a footer can do, which has no checksum; found by make soak."""
    dry.build()
    digest = dry.digest
    # the first of all, whose schema is looked at before anything else
    part = dry.root / min(p.path for p in read_manifest(dry.root).parts)
    table = pq.read_table(part, partitioning=None)
    if change == "another value":
        if not receipts:
            pytest.skip("what a detector said is known from nowhere else")
        at = table.schema.get_field_index("landmarks")
        moved = pa.array([[9.0] * 1404] * len(table), table.schema.field(at).type)
        table = table.set_column(at, table.schema.field(at), moved)
    else:
        names = [{"landmarks_visible": "landmarks_visibla"}.get(name, name) for name in table.column_names]
        table = table.rename_columns(names)
    pq.write_table(table, part)
    if not receipts:
        (dry.root / RECEIPTS_FILE).unlink()
    dry.build()
    assert len(dry.rendered) == len(table)
    assert dry.digest == digest
    dry.check()
