# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes are held against hash, camera, landmarks and visibility: what just holds, and what does not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from small_dataset import replaced

from generator.dataset.format.passes import passes_sha256, write_passes
from generator.dataset.format.row_cameras import RowCameras
from generator.dataset.format.schema import part_schema
from generator.dataset.format.unit_rows import UnitRows, unit_table
from generator.dataset.proof.context import RowContext
from generator.dataset.proof.pass_checks import disagreement, pass_problems, projection_error_px
from generator.labels import LABELS
from generator.plan.passes import DEPTH, POSITION, SEGMENTATION

pytest.importorskip("OpenEXR")

Channels = dict[str, np.ndarray]
X, _, Z = POSITION.channel_names
[D] = DEPTH.channel_names
NOTHING, FIRST, SECOND, *_ = SEGMENTATION.channel_names
ROW = 1


@dataclass(frozen=True)
class Wall:
    """A row that sees nothing but a wall at its pivot's depth, on which all its landmarks lie."""

    batch: pa.RecordBatch
    channels: Channels

    @property
    def name(self) -> str:
        """Of the row."""
        return self.batch.column("sample_id")[ROW].as_py()

    def problems(self, root: Path, channels: Channels, **columns: str) -> list[str]:
        """What is found if the row has these passes, and says this of them."""
        path = f"exr/{self.name}.exr"
        (root / path).parent.mkdir(parents=True, exist_ok=True)
        write_passes(channels, root / path)
        said = {"passes_path": path, "passes_sha256": passes_sha256(channels), **columns}
        batch = self.batch
        for name, text in said.items():
            texts = ["" if row != ROW else text for row in range(len(batch))]
            batch = replaced(batch, name, pa.array(texts))
        return list(pass_problems(batch, context_of(root)))


def context_of(root: Path) -> RowContext:
    """Of a dataset there; passes ask for nothing else."""
    return RowContext(root, "none", np.empty(0), expected_view=lambda head, pose: None)  # type: ignore[arg-type,return-value]


@pytest.fixture
def wall(rows: UnitRows) -> Wall:
    batch = unit_table(rows, part_schema("none", {}, "")).to_batches()[0]
    camera = RowCameras.of(batch)[ROW : ROW + 1]
    size, depth = int(camera.width[0]), float(camera.translation_mm[0, 2])
    places = np.stack(np.meshgrid(*[np.arange(size) + 0.5] * 2), axis=-1)
    rays = np.concatenate([places, np.ones((size, size, 1))], axis=-1) @ np.linalg.inv(camera.matrix[0]).T
    surface = rays * depth
    inner = surface[2:-2, 2:-2].reshape(-1, 3)
    points = np.broadcast_to(inner[:: len(inner) // 468][:468].ravel(), (len(batch), 468 * 3))
    exact = pa.FixedSizeListArray.from_arrays(pa.array(points.ravel(), pa.float32()), 468 * 3)
    shown = pa.FixedSizeListArray.from_arrays(pa.array(np.ones(len(batch) * 468, bool)), 468)
    batch = replaced(replaced(batch, "landmarks_exact", exact), "landmarks_visible", shown)
    metres = (surface * 1e-3).astype(np.float32)
    channels = dict(zip(POSITION.channel_names, np.moveaxis(metres, -1, 0), strict=True))
    channels |= {D: metres[..., 2], **{name: np.zeros((size, size)) for name in SEGMENTATION.channel_names}}
    channels[FIRST] = np.ones((size, size))
    return Wall(batch, {name: np.ascontiguousarray(v, np.float32) for name, v in channels.items()})


def added(name: str, value: float, pixels: int) -> Callable[[Channels], Channels]:
    """Something is added in so many pixels of a channel, from the middle on and around."""

    def change(channels: Channels) -> Channels:
        values = channels[name].copy()
        values.ravel()[(np.arange(pixels) + values.size // 2) % values.size] += np.float32(value)
        return {**channels, name: values}

    return change


def both(*changes: Callable[[Channels], Channels]) -> Callable[[Channels], Channels]:
    """One after the other."""

    def change(channels: Channels) -> Channels:
        for one in changes:
            channels = one(channels)
        return channels

    return change


def only_positions(channels: Channels) -> Channels:
    """Without the other passes."""
    return {name: channels[name] for name in POSITION.channel_names}


ALL = 64 * 64


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (added(D, 0, 0), ""),
        (lambda channels: {D: channels[D]}, ""),
        (lambda channels: {name: values[:32] for name, values in channels.items()}, "not the size of the"),
        (lambda channels: {name: values.T[1:].T.copy() for name, values in channels.items()}, "not the size"),
        # A pixel in a thousand may be anywhere: here four.
        (added(X, 0.1, 4), ""),
        (added(X, 0.1, 9), "positions do not project onto their own pixels"),
        (added(X, 4e-5, ALL), ""),  # a hundredth of a pixel is 46 micrometres here
        (added(X, 6e-5, ALL), "positions do not project onto their own pixels"),
        (lambda channels: {D: channels[D], Z: channels[Z]}, ""),
        (lambda channels: only_positions(added(X, 0.1, 9)(channels)), "positions do not project onto"),
        # Depths are right to a millimetre, but for one landmark in a hundred.
        (added(D, 0.0008, ALL), ""),
        (added(D, 0.0013, ALL), "landmarks_visible and depth disagree on 100.0% of the landmarks"),
        (added(D, -0.0008, ALL), ""),
        (added(D, -0.0013, ALL), "landmarks_visible and depth disagree on 100.0% of the landmarks"),
        (added(FIRST, 0.0005, 1), ""),
        (added(FIRST, 0.002, 1), "the classes of the segmentation do not add up to 1"),
        (added(FIRST, -0.002, 1), "the classes of the segmentation do not add up to 1"),
        (both(added(FIRST, 0.01, 1), added(SECOND, -0.01, 1)), "a share of the segmentation is below 0"),
        (added(FIRST, np.nan, 1), "a share of the segmentation is below 0"),
        (both(added(FIRST, -1, 4), added(NOTHING, 1, 4)), ""),
        (both(added(FIRST, -1, 5), added(NOTHING, 1, 5)), "the segmentation has nothing where the depth has"),
    ],
)
def test_what_passes_show(
    wall: Wall, tmp_path: Path, change: Callable[[Channels], Channels], said: str
) -> None:
    found = wall.problems(tmp_path, change(wall.channels))
    assert [problem.partition(": ")[0] for problem in found] == [f"exr/{wall.name}.exr"] * bool(said)
    assert said in "".join(found)


def test_nothing_is_asked_where_there_is_no_surface(wall: Wall, tmp_path: Path) -> None:
    empty = {name: np.full_like(wall.channels[D], np.nan) for name in (*POSITION.channel_names, D)}
    nothing = {name: np.zeros_like(wall.channels[D]) for name in SEGMENTATION.channel_names}
    background = {**empty, **nothing, NOTHING: np.ones_like(wall.channels[D])}
    [found] = wall.problems(tmp_path, background)
    assert "landmarks_visible and depth disagree on 100.0%" in found, "they are said to be seen"


def test_of_rows_with_passes_file_place_and_hash_are_asked(wall: Wall, tmp_path: Path) -> None:
    assert len(LABELS) == len(SEGMENTATION.channel_names) - 1
    for columns, said in (
        ({"passes_sha256": "0" * 64}, "the passes are not those that were rendered"),
        ({"passes_path": "exr/elsewhere.exr"}, "is not where its passes belong"),
        ({"passes_path": ""}, "is not where its passes belong"),
        ({"passes_sha256": ""}, "the passes are not those that were rendered"),
    ):
        [problem] = wall.problems(tmp_path, wall.channels, **columns)
        assert said in problem
    assert wall.problems(tmp_path, wall.channels, passes_path="", passes_sha256="") == []
    elsewhere = replaced(wall.batch, "passes_path", pa.array(["exr/elsewhere.exr"] * len(wall.batch)))
    assert len(list(pass_problems(elsewhere, context_of(tmp_path)))) == len(wall.batch)
    (tmp_path / "exr" / f"{wall.name}.exr").write_bytes(b"")
    batch = replaced(wall.batch, "passes_path", pa.array([f"exr/{n}.exr" for n in names_of(wall.batch)]))
    found = list(pass_problems(batch, context_of(tmp_path)))
    assert len(found) == len(batch), (
        "each file that is damaged or missing is a line, and the next is looked at"
    )


def names_of(batch: pa.RecordBatch) -> list[str]:
    """Its rows."""
    return batch.column("sample_id").to_pylist()


CAMERA = RowCameras(
    np.array([[[50.0, 0, 10], [0, 50.0, 10], [0, 0, 1]]]), np.array([[0.0, 0, 600]]),
    np.array(["perspective"]), np.array([20]), np.array([20]),
)  # fmt: skip


def seen_at(column: int, row: int, z: float = 600.0) -> np.ndarray:
    """The landmark in the middle of a pixel, [1, 3]."""
    return np.array([[(column - 9.5) / 50 * z, (row - 9.5) / 50 * z, z]])


@pytest.mark.parametrize("side", range(20))
def test_landmarks_at_the_border_of_the_image_are_not_asked(side: int) -> None:
    """There are no eight pixels around them."""
    depth = np.full((20, 20), 500.0)
    expected = float(1 <= side <= 18)
    for place in ((side, 9), (9, side)):
        assert disagreement(depth, seen_at(*place), np.array([True]), CAMERA) == expected


@pytest.mark.parametrize(("dx", "dy"), [*product((-2, -1, 0, 1, 2), repeat=2)])
def test_the_pixels_around_a_landmark_are_asked(dx: int, dy: int) -> None:
    """A surface behind it in one of the nine is enough for a landmark that is seen."""
    depth = np.full((20, 20), 500.0)
    depth[9 + dy, 9 + dx] = 700.0
    agrees = max(abs(dx), abs(dy)) <= 1
    assert disagreement(depth, seen_at(9, 9), np.array([True]), CAMERA) == float(not agrees)
    depth[9 + dy, 9 + dx] = np.nan
    assert disagreement(depth, seen_at(9, 9), np.array([True]), CAMERA) == float(not agrees)


def test_a_hidden_landmark_is_behind_the_nearest_surface_around() -> None:
    hidden, landmark = np.array([False]), seen_at(9, 9)
    for nearest, expected in ((500.0, 0.0), (600.9, 0.0), (601.1, 1.0), (np.nan, 1.0)):
        assert disagreement(np.full((20, 20), nearest), landmark, hidden, CAMERA) == expected


def test_landmarks_that_are_unknown_do_not_count() -> None:
    points = np.concatenate([seen_at(9, 9), np.full((3, 3), np.nan), seen_at(5, 5, 500.0)])
    assert disagreement(np.full((20, 20), 600.0), points, np.ones(5, bool), CAMERA) == 0.5


def test_the_error_of_positions_is_in_pixels_and_in_either_direction() -> None:
    columns, rows = np.meshgrid(np.arange(20), np.arange(20))
    wall = np.stack([(columns - 9.5) * 12.0, (rows - 9.5) * 12.0, np.full((20, 20), 600.0)], axis=-1)
    narrow = replace(CAMERA, width=np.array([20]))
    for off in ((12.0, 0, 0), (0, -12.0, 0)):
        assert projection_error_px(wall + np.array(off), narrow) == pytest.approx(1)
    wall[0] = np.nan
    assert projection_error_px(wall, CAMERA) == pytest.approx(0, abs=1e-9)
    assert projection_error_px(np.full_like(wall, np.nan), CAMERA) == 0.0


def test_every_row_is_looked_at_whatever_is_wrong_with_those_before(wall: Wall, tmp_path: Path) -> None:
    """One lies elsewhere, of one nothing is there, one is of another hash and one of another size."""
    names = wall.batch.column("sample_id").to_pylist()
    paths = [f"exr/{name}.exr" for name in names]
    hashes = ["0" * 64] * len(names)
    for place in (2, 3, 4):
        whole = wall.channels if place != 3 else {D: wall.channels[D][:32]}
        (tmp_path / paths[place]).parent.mkdir(parents=True, exist_ok=True)
        write_passes(whole, tmp_path / paths[place])
        hashes[place] = passes_sha256(whole) if place == 3 else hashes[place]
    paths[0] = "exr/elsewhere.exr"
    for place in range(5, len(names)):
        paths[place] = hashes[place] = ""
    batch = replaced(replaced(wall.batch, "passes_path", pa.array(paths)), "passes_sha256", pa.array(hashes))
    found = list(pass_problems(batch, context_of(tmp_path)))
    expected = ("not where its passes belong", paths[1], "SHA-256 differs", "not the size", "SHA-256 differs")
    assert len(found) == len(expected), found
    assert all(text in line for text, line in zip(expected, found, strict=True)), found
