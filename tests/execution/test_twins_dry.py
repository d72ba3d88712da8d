# SPDX-License-Identifier: GPL-3.0-or-later
"""Twins in builds without a renderer: their own table, the same rows, nothing else changed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from dry_build import DRAWN, DryBuild
from replaying import Lanes
from test_replay_dry import sha256

from generator.dataset.format.columns import LOOKS, ROWS
from generator.dataset.format.manifest import MANIFEST_FILE, read_manifest
from generator.dataset.format.part import read_part
from generator.dataset.proof.verify import verify_dataset
from generator.errors import UsageError, WorkerError
from generator.execution.build.unit_check import row_names
from generator.execution.deep import look_deep
from generator.execution.replay import replay_sample
from generator.plan.config import load_config
from generator.plan.factors import FACTORS

SOME = ["light", "lens", "jpeg", "noise", "backdrop", "glasses"]
TWINS = {"twins": SOME, "images": "files"}


def twins(dry: DryBuild) -> dict[str, dict[str, Any]]:
    """Every twin by its name."""
    files = sorted((dry.root / "twins").rglob("*.parquet"))
    return {row["sample_id"]: row for file in files for row in pq.read_table(file).to_pylist()}


def rows(dry: DryBuild) -> dict[str, dict[str, Any]]:
    table = pq.read_table(dry.root / "data", partitioning=None)
    return {row["sample_id"]: row for row in table.to_pylist()}


def told(dry: DryBuild) -> dict[str, str]:
    """Every twin as text, in which NaN equals NaN."""
    return {name: str(twin) for name, twin in twins(dry).items()}


def files(folder: Path) -> dict[str, str]:
    return {
        p.relative_to(folder).as_posix(): sha256(p.read_bytes()) for p in folder.rglob("*") if p.is_file()
    }


@pytest.mark.parametrize("variety", ["none", "photo"])
def test_twins_differ_in_their_factor_and_nowhere_else(dry: DryBuild, variety: str) -> None:
    render = {"variety": variety, "environment": "none", "backdrop": "plain"}
    dry.build(dataset=TWINS, render=render)
    base, found = rows(dry), twins(dry)
    assert len(found) == len(SOME) * len(base) == 72
    for name, twin in found.items():
        row, factor = base[twin["twin_of"]], FACTORS[twin["factor"]]
        assert name == f"{row['sample_id']}~{factor.name}"
        changed = {column for column in ROWS if column in row and str(row[column]) != str(twin[column])}
        own = {f"look_{key}" for key in factor.settings} & {*LOOKS}
        if factor.camera:
            own |= {"camera", "translation_mm"}
        assert changed & own, f"{name} differs in nothing of its factor"
        assert changed - own <= {"sample_id", "image_path", "image_sha256"}, name
        assert (dry.root / twin["image_path"]).is_file() and twin["image_path"] != row["image_path"]
    dry.check()


@pytest.mark.parametrize(
    "render",
    [
        {},
        {"lens_mm": 35, "margin": 1.4, "aspect": 1.5},
        {"distance_mm": 700, "lens_mm": 60},
        {"distance_mm": "log-uniform:400,8000", "zoom": True, "margin": "uniform:1,2", "aspect": 0.8},
    ],
)
def test_the_lens_keeps_the_head_as_large(dry: DryBuild, render: dict[str, Any]) -> None:
    """A sphere about the head has the same edge in the image, from wherever it is seen."""
    dry.build(dataset={"twins": ["lens"]}, render={"resolution": 64, **render})
    base, found = rows(dry), twins(dry)
    for twin in found.values():
        row = base[twin["twin_of"]]
        sine = np.sin(np.arctan(row["width"] / 2 / row["camera"][0]))
        reach_mm = sine * row["translation_mm"][2]  # of the sphere that touches the row's sides
        sine = reach_mm / twin["translation_mm"][2]
        assert np.tan(np.arcsin(sine)) * twin["camera"][0] == pytest.approx(row["width"] / 2, rel=1e-3)
        assert twin["translation_mm"][2] != row["translation_mm"][2]
    assert len({twin["translation_mm"][2] for twin in found.values()}) in ((1, 12) if render else (12,))


@pytest.mark.parametrize("images", ["files", "embedded", "none"])
def test_the_rows_do_not_know_of_twins(dry: DryBuild, images: str) -> None:
    """To the byte: their parts, their images, their digest, and whatever is read from data/."""
    dry.build(dataset={"images": images})
    data, digest, pictures = files(dry.root / "data"), dry.digest, files(dry.root / "images")
    assert "twins" not in json.loads((dry.root / MANIFEST_FILE).read_text())
    other = DryBuild(dry.root.parent / "other", "amy", "bob")
    other.build(dataset={"twins": SOME, "images": images})
    assert files(other.root / "data") == data and other.digest == digest
    assert files(other.root / "images").items() >= pictures.items()
    manifest = read_manifest(other.root)
    assert manifest.rows == 12 and sum(part.rows for part in manifest.twins) == 72
    other.check()


def test_a_factor_more_adds_its_twins_alone(dry: DryBuild) -> None:
    dry.build(dataset={"twins": ["light"]})
    before = files(dry.root / "twins")
    dry.build(dataset={"twins": ["light", "noise"]})
    assert {order.factor for order in dry.lanes.built} == {"noise"}
    assert files(dry.root / "twins").items() > before.items()
    dry.check()
    with pytest.raises(Exception, match="will be deleted"):
        dry.build(dataset={"twins": ["noise"]})
    dry.build(dataset={"twins": ["noise"]}, confirm=lambda what: True)
    assert not dry.lanes.built and {twin["factor"] for twin in twins(dry).values()} == {"noise"}
    dry.check()


def test_draws_of_twins_know_neither_other_heads_nor_poses_nor_settings(dry: DryBuild) -> None:
    poses = {**DRAWN, "same": False}
    dry.build(dataset={"twins": ["light"]}, poses=poses)
    before = told(dry)
    dry.add("cat")
    dry.build(dataset={"twins": ["jpeg", "light"]}, poses={**poses, "count": 9})
    after = told(dry)
    assert len(after) == 2 * 3 * 9 and after.items() >= before.items()
    dry.check()


def test_a_share_of_the_rows(dry: DryBuild) -> None:
    poses = {**DRAWN, "count": 40}
    dry.build(dataset={"twins": ["light", "jpeg"], "twins_share": 0.3, "unit_size": 10}, poses=poses)
    some = told(dry)
    assert 30 < len(some) < 66, "of 160, each with a chance of 0.3"
    assert {name.partition("~")[0] for name in some if name.endswith("~jpeg")} != {
        name.partition("~")[0] for name in some if name.endswith("~light")
    }
    dry.check()
    dry.build(
        dataset={"twins": ["light", "jpeg"], "twins_share": 0.6, "unit_size": 10},
        poses=poses,
        confirm=lambda what: True,
    )
    assert told(dry).items() > some.items(), "a larger share adds some and changes none"
    dry.check()


def test_a_grid_that_grows_takes_its_twins_along(dry: DryBuild) -> None:
    dry.build(dataset=TWINS)
    old = set(twins(dry))
    dry.build(dataset=TWINS, poses={"yaw": [-10, 20, 10], "pitch": [0, 0, 1], "roll": [0, 10, 10]})
    rendered = {
        f"{order.head.name}/{name}" for order in dry.lanes.built if order.factor for name in row_names(order)
    }
    assert rendered and not rendered & old and rendered | old == set(twins(dry))
    assert all((dry.root / twin["image_path"]).is_file() for twin in twins(dry).values())
    dry.check()


def test_a_build_that_was_stopped_goes_on_with_its_twins(dry: DryBuild) -> None:
    class Stopping(type(dry.lanes)):  # type: ignore[misc]
        def before(self, order: Any) -> None:
            if len(self.built) == 9:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        dry.build(dataset=TWINS, lanes=Stopping())
    dry.build(dataset=TWINS)
    assert len(dry.lanes.built) == 4 * 7 - 9
    dry.check()
    whole = DryBuild(dry.root.parent / "whole", "amy", "bob")
    whole.build(dataset=TWINS)
    assert files(whole.root / "twins") == files(dry.root / "twins")
    assert read_manifest(whole.root).twins_digest == read_manifest(dry.root).twins_digest


def test_twins_that_cannot_be_rendered_cost_no_row(dry: DryBuild) -> None:
    class Failing(type(dry.lanes)):  # type: ignore[misc]
        def before(self, order: Any) -> None:
            if getattr(order, "factor", "") == "jpeg":
                raise WorkerError("the lens fell off")

    result = dry.build(dataset=TWINS, lanes=Failing())
    assert result.failed_units == 4 and result.manifest.rows == 12
    [check] = [c for c in verify_dataset(dry.root).checks if not c.ok and c.name == "twins"]
    assert "4 units failed" in check.detail and "~jpeg is missing" in check.detail


def change(dry: DryBuild, name: str, column: str, value: Any, folder: str = "twins") -> None:
    """One value of one row, as somebody would who writes the manifest anew, too."""
    for file in (dry.root / folder).rglob("*.parquet"):
        table = read_part(file)
        names = table["sample_id"].to_pylist()
        if name in names:
            values = table[column].to_pylist()
            values[names.index(name)] = value
            place = table.schema.get_field_index(column)
            changed = pa.array(values, table.schema.field(place).type)
            pq.write_table(table.set_column(place, table.schema.field(place), changed), file)


NAME = "amy/neutral/y+10_p+0_r+10"


@pytest.mark.parametrize(
    ("factor", "column", "value", "said"),
    [
        ("jpeg", "look_jpeg", 33.0, "look_jpeg is not what the configuration plans"),
        ("jpeg", "look_jpeg", 100.0, "nothing of jpeg differs from its row"),
        ("jpeg", "look_noise", 0.1, "look_noise differs from its row, and is not of jpeg"),
        ("light", "look_glasses", "round", "look_glasses differs from its row, and is not of light"),
        ("lens", "translation_mm", [0.0, 0.0, 500.0], "translation_mm is not what the configuration plans"),
        ("noise", "landmarks_visible", [True] * 468, "landmarks_visible differs from its row"),
        ("noise", "twin_of", "amy/neutral/y+0_p+0_r+0", "of which it is no twin"),
        ("noise", "factor", "light", "should be called"),
        ("noise", "factor", "sparkle", "names no factor 'sparkle'"),
    ],
)
def test_verify_finds_what_was_changed(
    dry: DryBuild, factor: str, column: str, value: Any, said: str
) -> None:
    dry.build(dataset={"twins": SOME})
    change(dry, f"{NAME}~{factor}", column, value)
    report = verify_dataset(dry.root)
    assert said in " ".join(check.detail for check in report.checks), report.text()


def test_verify_finds_a_part_of_twins_that_is_gone(dry: DryBuild) -> None:
    dry.build(dataset={"twins": ["jpeg"]})
    next((dry.root / "twins").rglob("*.parquet")).unlink()
    for quick in (True, False):
        report = verify_dataset(dry.root, quick=quick)
        assert "twins" in {check.name for check in report.checks if check.count}, report.text()


def test_a_twin_is_rendered_again(dry: DryBuild, again: Lanes) -> None:
    dry.build(dataset={"images": "files", "twins": ["light", "lens"]})
    for name in (NAME, f"{NAME}~light", f"{NAME}~lens"):
        found = replay_sample(dry.root, name)
        assert found.same, found.text()
        assert found.compared.startswith(f"compared: images/{name}.png")
    with pytest.raises(UsageError, match="no sample"):
        replay_sample(dry.root, f"{NAME}~jpeg")


def test_all_of_them_are_rendered_again(dry: DryBuild, again: Lanes, monkeypatch: pytest.MonkeyPatch) -> None:
    dry.build(dataset={"images": "files", "twins": ["light", "jpeg"], "twins_share": 0.5})
    count = sum(part.rows for part in read_manifest(dry.root).twins)
    deep = look_deep(verify_dataset(dry.root), dry.root, None).deep
    assert deep is not None and deep.all_rows and deep.complete
    assert 0 < count < 24 and deep.rendered == deep.decoded == 12 + count
    some = look_deep(verify_dataset(dry.root), dry.root, 5).deep
    assert some is not None and some.rendered == 5


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ({"twins": ["sparkle"]}, "dataset.twins"),
        ({"twins_share": 1.5}, "dataset.twins_share"),
        ({"twins_share": -0.1}, "dataset.twins_share"),
    ],
)
def test_what_makes_no_sense_is_one_line(section: dict[str, Any], said: str) -> None:
    with pytest.raises(UsageError, match=said) as caught:
        load_config(None, {"dataset": section})
    assert "\n" not in str(caught.value)


def test_what_nothing_is_known_of(dry: DryBuild) -> None:
    with pytest.raises(UsageError, match="nothing says which thing a twin has"):
        dry.build(dataset={"twins": ["thing"]})


def test_a_lens_without_perspective(dry: DryBuild) -> None:
    with pytest.raises(UsageError, match="without perspective another lens changes nothing"):
        dry.build(dataset={"twins": ["lens"]}, render={"projection": "orthographic"})
