# SPDX-License-Identifier: GPL-3.0-or-later
"""COCO, and what exports have in common: the same bytes again, identities, catalogues."""

from __future__ import annotations

import io
import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from PIL import Image

from generator.dataset.export.huggingface import size_category
from generator.dataset.export.options import ExportOptions
from generator.dataset.export.run import export_dataset
from generator.landmarks.topology import FACE_MESH
from generator.registries import FORMATS

IBUG_68 = FACE_MESH.ibug_68.indices


@pytest.fixture(scope="module")
def rows(source) -> dict[str, dict]:
    """The table itself, by sample_id."""
    return {row["sample_id"]: row for row in pq.read_table(source / "data").to_pylist()}


@pytest.mark.parametrize("landmarks", ["exact", "detected"])
def test_coco_annotations(source, rows, tmp_path, landmarks):
    """What pycocotools takes them for is in test_export_readers.py, which is slow."""
    missing = "fail" if landmarks == "exact" else "skip"
    export_dataset(source, "coco", tmp_path / "out", ExportOptions(landmarks, missing))
    numbers = []
    for split in ("train", "validation"):
        read = json.loads((tmp_path / "out" / "annotations" / f"{split}.json").read_text())
        [category] = read["categories"]
        assert (category["id"], category["name"], len(category["keypoints"])) == (1, "face", 68)
        assert category["skeleton"][:2] == [[1, 2], [2, 3]], "COCO counts from 1"
        assert np.ptp(category["skeleton"]) == 67
        assert (
            len({licence["id"] for licence in read["licenses"]} | {i["license"] for i in read["images"]}) == 1
        )
        images = {image["id"]: image for image in read["images"]}
        for annotation in read["annotations"]:
            assert annotation["id"] == annotation["image_id"]
            image = images.pop(annotation["image_id"])
            numbers.append(annotation["id"])
            row = rows[image["file_name"].removesuffix(".png")]
            assert (row["split"], image["width"], image["height"]) == (split, 64, 64)
            shown = (tmp_path / "out" / "images" / split / image["file_name"]).read_bytes()
            assert shown == (source / row["image_path"]).read_bytes()
            assert (annotation["category_id"], annotation["iscrowd"]) == (1, 0)
            assert annotation["num_keypoints"] == 68
            points = np.array(annotation["keypoints"]).reshape(68, 3)
            visible = np.array(row["landmarks_visible"])[IBUG_68]
            flags = np.where(visible, 2, 1) if landmarks == "exact" else np.full(68, 2)
            np.testing.assert_array_equal(points[:, 2], flags)
            low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
            np.testing.assert_allclose(annotation["bbox"], [*low, *(high - low)])
            assert annotation["area"] == pytest.approx(np.prod(high - low))
        assert not images
    assert numbers == list(range(1, (36 if landmarks == "exact" else 32) + 1))


@pytest.mark.parametrize("name", FORMATS)
def test_two_exports_are_the_same_bytes(source, tmp_path, name):
    for out in ("a", "b"):
        export_dataset(source, name, tmp_path / out)
    files = sorted(p.relative_to(tmp_path / "a") for p in (tmp_path / "a").rglob("*") if p.is_file())
    assert files
    for file in files:
        if file.suffix != ".mat":  # MATLAB's header holds the time
            assert (tmp_path / "a" / file).read_bytes() == (tmp_path / "b" / file).read_bytes()
    assert (tmp_path / "a" / "README.md").is_file()


def test_images_come_from_the_table_where_they_are_embedded(tmp_path, build):
    build(tmp_path / "d", "embedded")
    export_dataset(tmp_path / "d", "biwi", tmp_path / "out")
    row = pq.read_table(tmp_path / "d" / "data").to_pylist()[0]
    written = (tmp_path / "out" / "train" / "01" / "frame_00001_rgb.png").read_bytes()
    assert written == row["image"]["bytes"]
    assert Image.open(io.BytesIO(written)).size == (64, 64)


def test_what_identities_are_is_written_beside_numbers(source, tmp_path):
    export_dataset(source, "biwi", tmp_path / "out")
    assert (tmp_path / "out" / "identities.csv").read_text().splitlines() == [
        "id,subject,expression,split,license,redistributable",
        "1,s1,neutral,train,CC0-1.0,True",
        "2,s2,neutral,validation,CC0-1.0,True",
    ]


FIELDS = {
    "sample_id": ("sc:Text", "string"),
    "image": ("sc:ImageObject", "image"),
    "detected": ("sc:Boolean", "bool"),
    "width": ("sc:Integer", "int32"),
    "yaw_deg": ("sc:Float", "float64"),
    "rotation": (["sc:Float"], ["float64", 9]),
    "landmarks": (["sc:Float"], ["float32", 1404]),
    "landmarks_visible": (["sc:Boolean"], ["bool", 468]),
}
"""What the types of some columns are in Croissant and on the hub; in a list: those of its elements."""


def test_the_catalogues_say_what_columns_are(source, tmp_path):
    """Their own readers are in test_export_readers.py, which is slow."""
    yaml = pytest.importorskip("yaml")
    export_dataset(source, "croissant", tmp_path / "out")
    described = json.loads((tmp_path / "out" / "croissant.json").read_text())
    assert described["license"] == ["https://creativecommons.org/publicdomain/zero/1.0/"]
    assert described["citeAs"] == "A. Person | 2020"
    assert "2 of the heads may be published" in described["description"]
    fields = {field["name"]: field for field in described["recordSet"][0]["field"]}
    schema = pq.read_schema(next((tmp_path / "out" / "data" / "train").iterdir()))
    assert list(fields) == schema.names
    front = yaml.safe_load((tmp_path / "out" / "README.md").read_text().split("---")[1])
    assert (front["license"], front["size_categories"]) == ("cc0-1.0", ["n<1K"])
    assert "license_name" not in front
    assert "found the face in 88.9% of the rows" in (tmp_path / "out" / "README.md").read_text()
    [info] = front["dataset_info"]
    assert [(one["name"], one["num_examples"]) for one in info["splits"]] == [
        ("train", 18),
        ("validation", 18),
    ]
    features = {feature.pop("name"): feature for feature in info["features"]}
    assert list(features) == schema.names
    stored = json.loads(schema.metadata[b"huggingface"])["info"]["features"]
    for name, (croissant, hub) in FIELDS.items():
        several = isinstance(croissant, list)
        assert fields[name]["dataType"] == (croissant[0] if several else croissant)
        assert fields[name].get("repeated", False) == several
        assert ("transform" in fields[name]["source"]) == (name == "image")
        assert features[name] == ({"sequence": hub[0], "length": hub[1]} if several else {"dtype": hub})
        value = {"dtype": hub[0] if several else hub, "_type": "Value"}
        one = {"feature": value, "length": hub[1], "_type": "Sequence"} if several else value
        assert stored[name] == ({"_type": "Image"} if name == "image" else one)


@pytest.mark.parametrize(
    ("rows", "category"),
    [
        *((1, "n<1K"), (999, "n<1K"), (1_000, "1K<n<10K"), (9_999, "1K<n<10K"), (10_000, "10K<n<100K")),
        *((99_999, "10K<n<100K"), (100_000, "100K<n<1M"), (999_999, "100K<n<1M"), (1_000_000, "n>1M")),
    ],
)
def test_the_size_as_the_hub_says_it(rows, category):
    assert size_category(rows) == category


def test_several_licences_are_other_and_each_is_named_in_the_catalogue(tmp_path, build):
    from small_dataset import HEADS

    names = ("CC-BY-4.0", "MIT", "urn:mine", "https://example.org/licence")
    heads = tuple(replace(HEADS[0], subject=f"p{k}", license=name) for k, name in enumerate(names))
    build(tmp_path / "d", "none", heads=heads)
    export_dataset(tmp_path / "d", "croissant", tmp_path / "out")
    described = json.loads((tmp_path / "out" / "croissant.json").read_text())
    assert described["license"] == [
        "https://creativecommons.org/licenses/by/4.0/",
        "MIT",
        "https://example.org/licence",
        "see README.md (urn:mine)",
    ]
    text = (tmp_path / "out" / "README.md").read_text()
    assert "license: other\nlicense_name: of-each-head-see-the-card" in text


def test_the_table_says_what_was_exported(source, tmp_path):
    export_dataset(source, "coco", tmp_path / "out", ExportOptions("detected", "skip"))
    lines = (tmp_path / "out" / "README.md").read_text().split("## Format")[0].splitlines()
    facts = [[cell.strip() for cell in line.split("|")[1:3]] for line in lines if line.startswith("|")][2:]
    assert facts[:6] == [
        ["format", "coco"],
        ["rows", "32 of 36"],
        ["landmarks", "detected"],
        ["rows left out", "4, for lack of a detection or landmarks"],
        ["heads", "2 of 2"],
        ["rows without landmarks", "left out"],
    ]
