# SPDX-License-Identifier: MIT
"""PoseImages under torch's own DataLoader: workers, shuffling, transforms, and what it refuses."""

from __future__ import annotations

import ideal
import numpy as np
import pytest
from PIL import Image

from downstream_hpe.errors import DataError

torch = pytest.importorskip("torch")

from torch.utils.data import DataLoader  # noqa: E402

from downstream_hpe import PoseImages  # noqa: E402

pytestmark = pytest.mark.slow

AXES = (np.array([-30.0, 0, 30]), np.array([-10.0, 10]), np.array([0.0, 20]))


@pytest.fixture
def table(tmp_path):
    """amy in train and bob in validation, twelve poses each; the colour of a picture says which row it is."""
    written = {}
    faces = ideal.Faces().draw(2, np.random.default_rng(1))
    for head, (name, split, face) in enumerate(
        zip(("amy", "bob"), ("train", "validation"), faces, strict=True)
    ):
        columns = ideal.rows(face, name, AXES, split)
        count = len(columns["detected"])
        ideal.drop(columns, 3)
        paths = [f"images/{name}/{k}.png" for k in range(count)]
        columns["camera"] = np.tile(np.array([100.0, 0, 8, 0, 100, 6, 0, 0, 1]), (count, 1))
        columns["translation_mm"] = np.tile([1.0, 2.0, 700.0 + head], (count, 1))
        columns["image_path"] = np.array(paths)
        (tmp_path / "images" / name).mkdir(parents=True)
        for k, path in enumerate(paths):
            Image.new("RGB", (16, 12), (10 * k, 100 + head, 7)).save(tmp_path / path)
        ideal.write(tmp_path / "data" / split / "part-0.parquet", columns)
        written[name] = columns
    return written


def test_workers_shuffle_and_batch_it(tmp_path, table):
    images = PoseImages(tmp_path, landmarks=True)
    assert len(images) == 24
    torch.manual_seed(0)
    batches = list(DataLoader(images, batch_size=5, shuffle=True, num_workers=2))
    assert [len(batch["head"]) for batch in batches] == [5, 5, 5, 5, 4]
    seen = []
    for batch in batches:
        assert batch["image"].shape[1:] == (3, 12, 16) and batch["image"].dtype == torch.float32
        for k, head in enumerate(batch["head"]):
            row = int(torch.round(batch["image"][k, 0, 0, 0] * 255)) // 10  # red, first: RGB
            name = head.split("/")[0]
            columns = table[name]
            assert round(float(batch["image"][k, 1, 0, 0]) * 255) == {"amy": 100, "bob": 101}[name]
            np.testing.assert_allclose(batch["rotation"][k].ravel(), columns["rotation"][row], atol=1e-6)
            expected = [columns[f"{angle}_deg"][row] for angle in ("yaw", "pitch", "roll")]
            assert batch["ypr_deg"][k].tolist() == expected
            np.testing.assert_array_equal(batch["camera"][k].ravel(), columns["camera"][row])
            np.testing.assert_array_equal(batch["translation_mm"][k], columns["translation_mm"][row])
            assert bool(batch["detected"][k]) == (row != 3)
            np.testing.assert_array_equal(batch["landmarks"][k].ravel(), columns["landmarks"][row])
            seen.append((name, row))
    assert sorted(seen) == [(name, row) for name in ("amy", "bob") for row in range(12)]
    assert seen != sorted(seen)


def test_a_split_and_transforms(tmp_path, table):
    def small(picture):
        assert isinstance(picture, Image.Image) and picture.mode == "RGB" and picture.size == (16, 12)
        return np.asarray(picture)[:2, :2]

    def mirrored(item):
        turn = torch.diag(torch.tensor([-1.0, 1, 1]))
        return {**item, "image": item["image"][:, ::-1].copy(), "rotation": turn @ item["rotation"] @ turn}

    images = PoseImages(tmp_path, "validation", transform=small, item_transform=mirrored)
    assert len(images) == 12 and "landmarks" not in images[0]
    item = images[5]
    assert item["image"].tolist() == [[[50, 101, 7]] * 2] * 2 and item["head"] == "bob/neutral"
    expected = table["bob"]["rotation"][5].reshape(3, 3) * [[1, -1, -1], [-1, 1, 1], [-1, 1, 1]]
    np.testing.assert_allclose(item["rotation"], expected, atol=1e-6)


def refused(match, *arguments):
    with pytest.raises(DataError, match=match) as caught:
        PoseImages(*arguments)
    assert "\n" not in str(caught.value)


def test_what_it_refuses(tmp_path, table):
    refused("no row of split 'test'", tmp_path, "test")
    columns = {**table["amy"], "image_path": np.array([""] * 12)}
    ideal.write(tmp_path / "embedded" / "a.parquet", columns)
    refused("its images are not files; build with --images files", tmp_path / "embedded")
    del columns["image_path"]
    ideal.write(tmp_path / "none" / "a.parquet", columns)
    refused("no column image_path; build with --images files", tmp_path / "none")
    (tmp_path / "images/amy/4.png").unlink()
    with pytest.raises(DataError, match=r"4\.png: there is no such picture"):
        PoseImages(tmp_path, "train")[4]
    Image.new("RGB", (4, 4)).save(tmp_path / "outside.png")
    columns = {**table["amy"], "image_path": np.array(["../outside.png"] * 12)}
    ideal.write(tmp_path / "stranger" / "a.parquet", columns)
    with pytest.raises(DataError, match="lies outside of the dataset"):
        PoseImages(tmp_path / "stranger")[0]
