# SPDX-License-Identifier: GPL-3.0-or-later
"""What an export refuses, in one line, and that it leaves nothing behind when it does."""

from __future__ import annotations

import json
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from small_dataset import HEADS

from generator import cli
from generator.dataset.export.licence import Withheld, check_licences
from generator.dataset.export.options import OVERRIDE, ExportOptions
from generator.dataset.export.run import export_dataset
from generator.dataset.format.manifest import read_manifest
from generator.errors import DatasetError, HeadturnError, UsageError
from generator.plan.poses import grid_plan
from generator.registries import FORMATS
from generator.sealed import sealed


@pytest.fixture(scope="module")
def mixed(tmp_path_factory, build) -> Path:
    """s1 may be published, s2 may not; images embedded."""
    root = tmp_path_factory.mktemp("gate") / "dataset"
    secret = replace(HEADS[1], license="FaceScape", redistributable=False, attribution="")
    build(root, "embedded", heads=(HEADS[0], secret))
    return root


def tree(folder: Path) -> list[str]:
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*"))


def refused(error: type[HeadturnError], *arguments, says: tuple[str, ...], **options) -> None:
    """The export raises one line that says this, and writes nothing."""
    target = arguments[2]
    before = tree(target.parent)
    with pytest.raises(error) as caught:
        export_dataset(*arguments, **options)
    message = str(caught.value)
    assert "\n" not in message
    for text in says:
        assert text in message, message
    assert tree(target.parent) == before


@pytest.mark.parametrize("name", ["huggingface", "croissant"])
def test_formats_for_publication_refuse_and_name_the_subjects(mixed, tmp_path, name):
    says = ("18 of 36 rows", "1 of 2 subjects", "s2", "--only-redistributable", OVERRIDE)
    refused(UsageError, mixed, name, tmp_path / "out", says=says)


@pytest.mark.parametrize("name", FORMATS)
def test_any_format_refuses_with_public_and_not_without(mixed, tmp_path, name):
    refused(UsageError, mixed, name, tmp_path / "out", ExportOptions(public=True), says=("s2",))
    if name not in ("huggingface", "croissant"):
        assert export_dataset(mixed, name, tmp_path / "out").rows == 36


@pytest.mark.parametrize("name", FORMATS)
def test_only_redistributable_leaves_the_others_out_of_every_file(mixed, tmp_path, name):
    options = ExportOptions(public=True, only_redistributable=True)
    done = export_dataset(mixed, name, tmp_path / "out", options)
    assert (done.rows, done.heads, done.withheld) == (18, 1, 18)
    for path in (tmp_path / "out").rglob("*"):
        assert "s2" not in path.name
        if path.suffix in (".txt", ".json", ".jsonl", ".yaml", ".csv", ".md"):
            assert "s2" not in path.read_text() and "FaceScape" not in path.read_text()
        if path.suffix in (".tar", ".tfrecord"):
            assert not re.search(rb"\bs2\b|FaceScape", path.read_bytes())
    for path in (tmp_path / "out").rglob("*.parquet"):
        assert set(pq.read_table(path)["subject"].to_pylist()) == {"s1"}
    assert "Only heads whose images may be published" in (tmp_path / "out" / "README.md").read_text()


def test_rows_are_left_out_of_parts_that_hold_several_heads(mixed, tmp_path):
    shutil.copytree(mixed, tmp_path / "d")
    manifest = json.loads((tmp_path / "d" / "manifest.json").read_text())
    for part in manifest["parts"]:
        part["subject"] = part["expression"] = ""  # what the manifest says of a part of several heads
    (tmp_path / "d" / "manifest.json").write_text(json.dumps(sealed(manifest)))
    options = ExportOptions(only_redistributable=True)
    assert export_dataset(tmp_path / "d", "huggingface", tmp_path / "out", options).rows == 18


def test_the_override_is_written_on_the_card(mixed, dataset, tmp_path):
    for root, options in ((mixed, ExportOptions()), (dataset, ExportOptions(may_publish=True))):
        export_dataset(root, "6drepnet", tmp_path / root.parent.name, options)
        assert OVERRIDE not in (tmp_path / root.parent.name / "README.md").read_text(), (
            "and where it was needed"
        )
    done = export_dataset(mixed, "huggingface", tmp_path / "out", ExportOptions(may_publish=True))
    assert (done.rows, done.heads, done.withheld) == (36, 2, 0)
    card = (tmp_path / "out" / "README.md").read_text()
    assert OVERRIDE in card and "Do not publish" in card and "FaceScape" in card


def test_a_refusal_names_a_few_subjects_and_counts_the_rest(tmp_path, build):
    heads = tuple(
        replace(HEADS[0], subject=f"p{k}", license="FaceScape", redistributable=False) for k in range(8)
    )
    build(tmp_path / "d", "none", heads=heads)
    refused(UsageError, tmp_path / "d", "huggingface", tmp_path / "out",
            says=("8 of 8 subjects", "p0, p1, p2, p3, p4 and 3 more"))  # fmt: skip
    options = ExportOptions(only_redistributable=True)
    refused(UsageError, tmp_path / "d", "huggingface", tmp_path / "out", options, says=("leaves nothing",))


@pytest.mark.parametrize(
    ("count", "names"), [(2, "p0, p1"), (5, "p0, p1, p2, p3, p4"), (6, "p0, p1, p2, p3, p4 and 1 more")]
)
def test_five_names_and_how_many_more(count, names):
    assert Withheld(tuple(f"p{k}" for k in range(count)), 0).names == names


@pytest.mark.parametrize(("of_heads", "of_rows"), [(False, True), (True, False)])
def test_either_heads_or_rows_may_forbid_all(tmp_path, build, of_heads, of_rows):
    root = tmp_path / "d"
    build(root, "none", heads=tuple(replace(h, redistributable=of_rows and h is HEADS[1]) for h in HEADS))
    heads = [replace(head, redistributable=of_heads) for head in HEADS]
    options = ExportOptions(only_redistributable=True)
    with pytest.raises(UsageError, match="leaves nothing"):
        check_licences(root, read_manifest(root), heads, options, True)


def test_a_target_that_is_not_empty_a_file_or_inside_is_refused(dataset, tmp_path):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "precious.txt").write_text("keep me")
    refused(UsageError, dataset, "biwi", tmp_path / "full", says=("full", "not empty"))
    assert (tmp_path / "full" / "precious.txt").read_text() == "keep me"
    refused(UsageError, dataset, "biwi", tmp_path / "full" / "precious.txt", says=("is a file",))
    refused(UsageError, dataset, "biwi", dataset / "export", says=("inside the dataset",))
    (tmp_path / "empty").mkdir()
    assert export_dataset(dataset, "biwi", tmp_path / "empty").rows == 36


def test_a_killed_export_is_not_in_the_way(dataset, tmp_path):
    left = tmp_path / ".out.export.tmp"
    left.mkdir()
    (left / "half.txt").write_text("")
    export_dataset(dataset, "6drepnet", tmp_path / "out")
    assert not left.exists() and not (tmp_path / "out" / "half.txt").exists()


@pytest.mark.parametrize("name", FORMATS)
def test_a_part_or_an_image_deleted_by_hand(dataset, tmp_path, name):
    image = next((dataset / "images").rglob("*.png"))
    image.unlink()
    refused(DatasetError, dataset, name, tmp_path / "out", says=(image.name, "headturn verify"))
    part = next((dataset / "data").rglob("*.parquet"))
    part.unlink()
    refused(DatasetError, dataset, name, tmp_path / "out", says=(part.name, "headturn verify"))


def test_an_unfinished_dataset(dataset, tmp_path):
    (dataset / "manifest.json").unlink()
    refused(DatasetError, dataset, "coco", tmp_path / "out", says=("did not finish",))


def test_a_dataset_of_another_major_version(dataset, tmp_path):
    manifest = json.loads((dataset / "manifest.json").read_text())
    (dataset / "manifest.json").write_text(json.dumps({**manifest, "schema_version": "2.0.0"}))
    refused(DatasetError, dataset, "coco", tmp_path / "out", says=("2.0.0", "build it again"))


@pytest.mark.parametrize("name", FORMATS)
def test_without_images(tmp_path, build, name):
    build(tmp_path / "d", "none")
    if name in ("nlml-hpe", "300w-lp", "fsanet-npz", "biwi", "coco", "yolo-pose", "webdataset", "tfrecord"):
        refused(DatasetError, tmp_path / "d", name, tmp_path / "out", says=("images = none", name))
        return
    export_dataset(tmp_path / "d", name, tmp_path / "out")
    if name == "6drepnet":
        assert "s1/neutral/y+0_p+0_r+0 " in (tmp_path / "out" / "labels_train.txt").read_text()
    else:
        schema = pq.read_schema(next((tmp_path / "out" / "data" / "train").iterdir()))
        assert "image" not in schema.names


def test_poses_that_are_not_whole_degrees_have_no_name_in_nlml_hpe(tmp_path, build):
    build(tmp_path / "d", plan=grid_plan((-2.5, 2.5, 2.5), (0, 0, 1), (0, 0, 1)))
    refused(UsageError, tmp_path / "d", "nlml-hpe", tmp_path / "out", says=("whole degrees",))


@pytest.mark.parametrize("name", ["300w-lp", "coco", "yolo-pose"])
def test_rows_without_landmarks_are_a_choice_never_zeros(dataset, tmp_path, name):
    def export(target, **options):
        return export_dataset(dataset, name, tmp_path / target, ExportOptions(**options))

    refused(UsageError, dataset, name, tmp_path / "a", ExportOptions(landmarks="detected"),
            says=("no face was found", "4 rows of 36", "--missing skip"))  # fmt: skip
    refused(UsageError, dataset, name, tmp_path / "a", ExportOptions(missing="keep"),
            says=("--missing keep", "fail, skip, exact"))  # fmt: skip
    skipped = export("b", landmarks="detected", missing="skip")
    assert (skipped.rows, skipped.left_out, skipped.filled) == (32, 4, 0)
    filled = export("c", landmarks="detected", missing="exact")
    assert (filled.rows, filled.left_out, filled.filled) == (36, 0, 4)
    if name == "coco":
        annotations = json.loads((tmp_path / "c" / "annotations" / "train.json").read_text())["annotations"]
        origins = [a["landmark_source"] for a in annotations]
        assert origins.count("exact") == 2 and origins.count("detected") == 16
        assert all(a["detected"] == (a["landmark_source"] == "detected") for a in annotations)
        assert all(np.array(a["keypoints"]).reshape(68, 3)[:, :2].min() > 1 for a in annotations)
    assert "4 rows filled with exact ones" in (tmp_path / "c" / "README.md").read_text()


@pytest.mark.parametrize("name", ["nlml-hpe", "6drepnet", "fsanet-npz", "biwi", "huggingface", "croissant"])
def test_rows_without_a_detection_in_formats_without_need_of_one(dataset, tmp_path, name):
    refused(UsageError, dataset, name, tmp_path / "a", ExportOptions(missing="fail"),
            says=("no face was found",))  # fmt: skip
    done = export_dataset(dataset, name, tmp_path / "b", ExportOptions(missing="skip"))
    assert (done.rows, done.left_out) == (32, 4)
    for path in (tmp_path / "b" / "data").rglob("*.parquet"):
        assert pq.read_table(path)["detected"].to_pylist().count(False) == 0


def test_an_image_format_that_is_none_of_the_formats(dataset, tmp_path):
    refused(UsageError, dataset, "nlml-hpe", tmp_path / "a", ExportOptions(image_format="bmp"),
            says=("--image-format bmp", "takes one of jpg, png"))  # fmt: skip
    refused(UsageError, dataset, "biwi", tmp_path / "a", ExportOptions(image_format="jpg"),
            says=("--image-format jpg", "biwi has no choice of it"))  # fmt: skip


def test_landmarks_that_are_no_choice(dataset, tmp_path):
    refused(UsageError, dataset, "coco", tmp_path / "a", ExportOptions(landmarks="best"),
            says=("--landmarks 'best': expected one of auto, exact, detected",))  # fmt: skip


def test_an_export_without_a_row_is_none(tmp_path, build):
    """Also of formats with boxes, which asked for the points of no rows and ended in a traceback."""
    build(tmp_path / "d", plan=grid_plan((30, 30, 1), (20, 20, 1), (0, 10, 10)))  # none of them is detected
    for name, landmarks in (("coco", "detected"), ("huggingface", "auto"), ("biwi", "auto")):
        refused(UsageError, tmp_path / "d", name, tmp_path / "a", ExportOptions(landmarks, "skip"),
                says=("no row is left to export",))  # fmt: skip


def test_heads_without_anchors(tmp_path, build, monkeypatch):
    import small_dataset

    monkeypatch.setattr(small_dataset, "face_anchors", lambda: np.full((468, 3), np.nan))
    heads = tuple(replace(head, anchor_absent=468) for head in HEADS)
    build(tmp_path / "d", heads=heads)
    refused(UsageError, tmp_path / "d", "coco", tmp_path / "out", ExportOptions(landmarks="exact"),
            says=("no head has exact landmarks", "--landmarks detected"))  # fmt: skip
    refused(UsageError, tmp_path / "d", "coco", tmp_path / "out", ExportOptions("detected", "exact"),
            says=("no face was found and its head has no exact landmarks",))  # fmt: skip
    done = export_dataset(tmp_path / "d", "coco", tmp_path / "out", ExportOptions(missing="skip"))
    assert (done.landmarks, done.rows) == ("detected", 32)


def test_a_full_disk_leaves_nothing(dataset, tmp_path, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_text", full)
    refused(DatasetError, dataset, "biwi", tmp_path / "out", says=("out", "No space left"))


def test_a_damaged_part(dataset, tmp_path):
    part = next((dataset / "data").rglob("*.parquet"))
    part.write_bytes(part.read_bytes()[:-100])
    refused(DatasetError, dataset, "coco", tmp_path / "out", says=(part.name,))


def test_the_command(dataset, tmp_path, monkeypatch, capsys):
    def headturn(*arguments) -> int:
        monkeypatch.setattr(sys, "argv", ["headturn", *map(str, arguments)])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        return stopped.value.code or 0

    out = tmp_path / "out"
    assert headturn("export", dataset, "--format", "coco", "--out", out, "--json") == 0
    assert json.loads(capsys.readouterr().out)["rows"] == 36
    assert headturn("export", dataset, "--format", "coco", "--out", out) == 2
    assert "not empty" in capsys.readouterr().err
    assert headturn("export", dataset, "--format", "6drepnet", "--out", tmp_path / "six") == 0
    assert "6DRepNet's own code reads 300w-lp and fsanet-npz" in capsys.readouterr().out
    assert headturn("export", dataset, "--format", "tape", "--out", out) == 2
    assert headturn("export", tmp_path / "nowhere", "--format", "coco", "--out", tmp_path / "o") == 1
    errors = [line for line in capsys.readouterr().err.splitlines() if line.startswith("headturn: ")]
    assert len(errors) == 2 and "--format 'tape': expected one of nlml-hpe" in errors[0]
    assert "no such folder" in errors[1]


def test_the_help_names_the_formats(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["headturn", "export", "--help"])
    with pytest.raises(SystemExit):
        cli.main()
    words = set(capsys.readouterr().out.replace(",", " ").replace(".", " ").split())
    assert set(FORMATS) <= words


def test_exported_parts_keep_their_metadata(dataset, tmp_path):
    export_dataset(dataset, "huggingface", tmp_path / "out")
    schema = pq.read_schema(next((tmp_path / "out" / "data" / "train").iterdir()))
    assert schema.metadata[b"headturn.images"] == b"embedded"
    assert b"R_C" in schema.metadata[b"headturn.conventions"]
    assert pa.types.is_struct(schema.field("image").type)
    assert "passes_path" not in schema.names


@pytest.mark.parametrize("name", ["coco", "huggingface"])
def test_an_image_that_was_changed_is_not_exported(dataset, tmp_path, name):
    """Though it is an image: without its row's hash nobody knows what it shows."""
    one, other = sorted((dataset / "images/s1/neutral").iterdir())[4:6]
    one.write_bytes(other.read_bytes())
    refused(DatasetError, dataset, name, tmp_path / "out", ExportOptions(missing="skip"),
            says=("is not the one that was rendered",))  # fmt: skip
