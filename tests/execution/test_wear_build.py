# SPDX-License-Identifier: GPL-3.0-or-later
"""Whatever is worn: drawn, made once, seen in pixels, known to visibility, and left out with a reason."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image
from small_builds import config_for, run

from generator.dataset.format.open import as_array
from generator.dataset.proof.verify import verify_dataset
from generator.errors import UsageError
from generator.heads.mesh import HeadMesh, Material
from generator.labels import GLASSES, OCCLUDER
from generator.picture.settled import settled
from generator.plan.wear import STYLES
from generator.registries import WORN
from generator.worn.fit import CannotWear, Fit, Kind

RED = (1.0, 0.0, 0.0)


def plate(fit: Fit, size: float, opacity: float = 1.0, label: str = OCCLUDER) -> HeadMesh:
    """A red square of so many mm before the nose; what is clear stands nearer to it."""
    [nose] = fit.at(1)
    corners = (
        np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * size / 2 + nose + [0, 0, 20 * opacity]
    )
    triangles = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    red = Material("red", RED, opacity=opacity, label=label)
    return HeadMesh(corners, triangles, None, None, np.zeros(2, np.int32), (red,))


def glasses(fit: Fit, style: str, rng: np.random.Generator) -> HeadMesh:
    if style == "square":
        raise CannotWear("they are too small")
    return plate(fit, 50.0, 0.1, GLASSES)


@pytest.fixture(autouse=True)
def kinds(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """A plate, a clear one, and one that does not fit."""
    monkeypatch.setitem(WORN._entries, "occluder", Kind(lambda fit, style, rng: plate(fit, 50.0)))
    monkeypatch.setitem(WORN._entries, "glasses", Kind(glasses))
    monkeypatch.setitem(STYLES, "glasses", ("none", "round", "square"))
    yield


def reds(path: Path) -> np.ndarray:
    """The pixels of an image that are the plate's, as [K, 2] (row, column)."""
    with Image.open(path) as image:
        red, green, blue = np.moveaxis(np.asarray(image.convert("RGB"), float), -1, 0)
    return np.argwhere((red > 90) & (green < 20) & (blue < 20))


@pytest.mark.slow
def test_it_hides_landmarks_or_is_left_out_and_verifies(parametric_heads: Path, tmp_path: Path) -> None:
    render = {
        "occluder": "choice:none,hand",
        "occluder_x": "choice:0,0,0.6",
        "glasses": "choice:none,round,square",
    }
    config = config_for(
        parametric_heads,
        render=render,
        poses={"yaw": [-20, 20, 20], "pitch": [-10, 10, 10], "roll": [0, 0, 10]},
        dataset={"passes": ["depth", "object_index"]},
    )
    root = tmp_path / "dataset"
    run(config, root, "serial")
    table = pq.read_table(root / "data")
    rows = table.to_pylist()
    visible = as_array(table.combine_chunks().to_batches()[0], "landmarks_visible").astype(bool)
    nose = visible[:, 1]
    before = np.array([r["look_occluder"] == "hand" and r["look_occluder_x"] == 0 for r in rows])
    aside = np.array([r["look_occluder"] == "hand" and r["look_occluder_x"] > 0 for r in rows])
    assert before.any() and aside.any() and (~before).any()
    assert not nose[before].any() and nose[~before].all(), "a clear plate, or one aside, hides nothing"
    seen = [reds(root / r["image_path"]) for r in rows]
    red = np.array([len(pixels) for pixels in seen])
    assert red[before | aside].min() > 60 and red[~(before | aside)].max() < 10
    exact = as_array(table.combine_chunks().to_batches()[0], "landmarks_exact")[:, 1].astype(float)
    k = np.stack([r["camera"] for r in rows]).reshape(-1, 3, 3)
    nose_x = exact[:, 0] / exact[:, 2] * k[:, 0, 0] + k[:, 0, 2]
    right = np.array([pixels[:, 1].mean() if len(pixels) else np.nan for pixels in seen]) - nose_x
    assert right[aside].min() > 10 and np.abs(right[before]).max() < 8, "moved to the right in the image, too"
    left_out = [r["look_left_out"] for r in rows]
    assert [bool(text) for text in left_out] == [r["look_glasses"] == "square" for r in rows]
    assert {*left_out} == {"", "glasses: they are too small"}
    report = verify_dataset(root)
    assert report.ok, report.text()


def test_a_style_that_is_not_there_is_refused() -> None:
    with pytest.raises(UsageError, match=r"render.glasses: no glasses 'big'; there are none, round, square"):
        settled(config_for("parametric", render={"glasses": "choice:none,big"}))


def test_all_is_every_style() -> None:
    config = settled(config_for("parametric", render={"headphones": "head:choice:all"}))
    drawn = config.drawn["render.headphones"]
    assert drawn.per_head and drawn.texts[0] == "none" and "over-ear" in drawn.texts
