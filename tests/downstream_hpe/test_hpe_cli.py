# SPDX-License-Identifier: MIT
"""The command as people meet it, on a tiny dataset: fit, evaluate, export, predict, and mistakes."""

from __future__ import annotations

import csv
import json
import re
import sys

import ideal
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from downstream_hpe import cli, fitting

pytestmark = pytest.mark.slow

pytest.importorskip("torch")
pytest.importorskip("onnxruntime")


def run(*arguments, monkeypatch):
    """Run the command in this process; its exit code."""
    monkeypatch.setattr(sys, "argv", ["downstream-hpe", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return stopped.value.code or 0


def counted_from(zero, folder):
    """Say in a dataset's manifest, as headturn build does, from where its angles count."""
    manifest = {"configuration": {"poses": {"frame": zero}}}
    (folder / "manifest.json").write_text(json.dumps(manifest))


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Eight ideal heads, two of them for validation, a few cells not detected."""
    folder = tmp_path_factory.mktemp("dataset")
    for n, face in enumerate(ideal.Faces().draw(8, np.random.default_rng(1))):
        columns = ideal.rows(face, f"s{n}", split="validation" if n > 5 else "train")
        ideal.drop(columns, n)
        ideal.write(folder / "data" / f"part-{n}.parquet", columns)
    counted_from("canonical", folder)
    return folder


@pytest.fixture(scope="module")
def extra(tmp_path_factory):
    """Two more ideal heads, beside the grid and a little beyond it."""
    folder = tmp_path_factory.mktemp("extra")
    for n, face in enumerate(ideal.Faces().draw(2, np.random.default_rng(2))):
        columns = ideal.rows(face, f"x{n}", tuple(1.2 * axis[1:] for axis in ideal.AXES))
        columns |= {f"{angle}_index": np.full(64, -1, np.int16) for angle in ("yaw", "pitch", "roll")}
        ideal.write(folder / "data" / f"part-{n}.parquet", columns)
    counted_from("canonical", folder)
    return folder


@pytest.fixture(scope="module")
def model(dataset, extra, tmp_path_factory):
    folder = tmp_path_factory.mktemp("model") / "model"
    with pytest.MonkeyPatch.context() as patch:
        # Of ideal faces the frontal one, rotated, is what was missed; the masked fit takes many passes.
        code = run("fit", dataset, "--out", folder, "--missing", "frontal", "--epochs", "15",
                   "--threads", "1", "--extra", extra, monkeypatch=patch)  # fmt: skip
    assert code == 0
    return folder


@pytest.mark.parametrize("command", ["fit", "evaluate", "predict", "export"])
def test_every_command_has_help_with_an_example(command, monkeypatch, capsys):
    assert run(command, "--help", monkeypatch=monkeypatch) == 0
    assert f"Example: downstream-hpe {command}" in re.sub(r"\s+", " ", capsys.readouterr().out)


def test_fit_holds_out_the_validation_split(model):
    card = json.loads((model / "model.json").read_text())
    assert card["held_out_subjects"] == ["s6", "s7"]
    # The tensor has the grid's heads; the networks those of the other dataset too.
    assert card["trained_subjects"] == ["s0", "s1", "s2", "s3", "s4", "s5", "x0", "x1"]
    assert card["rows"] == 6 * 125 - 6 + 2 * 64
    assert card["cells_without_landmarks"] == 6
    by_name = {entry["estimator"]: entry for entry in card["held_out"]}
    assert by_name["reconstruction"]["mae"] < 0.05
    assert by_name["encoder + heads"]["mae"] < 0.5 * by_name["constant zero"]["mae"]


def test_confidence_is_calibrated_on_others(dataset, extra, tmp_path, monkeypatch, capsys):
    """On faces of its own, if it is told to, and never on whom it was trained on."""
    short = ["fit", dataset, "--missing", "frontal", "--epochs", "1", "--threads", "1", "--calibrate"]
    assert run(*short, extra, "--out", tmp_path / "model", monkeypatch=monkeypatch) == 0
    assert "confidence calibrated on 128 faces of 2 subjects" in capsys.readouterr().err
    assert run(*short, extra, "--extra", extra, "--out", tmp_path / "none", monkeypatch=monkeypatch) == 1
    assert "every subject is trained on; calibrate on others" in capsys.readouterr().err


def test_faces_near_the_end_of_a_dataset_are_left_to_a_wider_one(dataset, tmp_path, monkeypatch, capsys):
    [face] = ideal.Faces().draw(1, np.random.default_rng(4))
    wide = (np.array([-85.0, 0, 85]), *(axis[1:] for axis in ideal.AXES[1:]))
    columns = ideal.rows(face, "w0", wide)
    columns |= {f"{angle}_index": np.full(48, -1, np.int16) for angle in ("yaw", "pitch", "roll")}
    ideal.write(tmp_path / "wide" / "data" / "part.parquet", columns)
    counted_from("canonical", tmp_path / "wide")
    fit = [
        "fit",
        dataset,
        "--missing",
        "frontal",
        "--epochs",
        "1",
        "--threads",
        "1",
        "--out",
        tmp_path / "model",
    ]
    assert run(*fit, "--extra", tmp_path / "wide", monkeypatch=monkeypatch) == 0
    said = re.search(r"(\d+) faces left out: near the end of their dataset", capsys.readouterr().err)
    # Of eight heads, the two yaws of 50 degrees: 25 poses each, a few of which were not found.
    assert said is not None and abs(int(said[1]) - 8 * 50) < 20


def test_partial_faces_are_learned_from_and_scored(dataset, extra, tmp_path, monkeypatch, capsys):
    """Half faces, of which no detector found one."""
    seen = tmp_path / "seen"
    for n, face in enumerate(ideal.Faces().draw(3, np.random.default_rng(3))):
        columns = ideal.rows(face, f"p{n}", tuple(axis[1:] for axis in ideal.AXES))
        points = columns["landmarks"].astype(float).reshape(-1, 468, 3) - 128
        columns["landmarks_exact"] = (points + np.array([0, 0, 700.0])).reshape(-1, 1404)
        columns["landmarks_visible"] = points[..., 0] < np.median(points[..., 0], axis=1, keepdims=True)
        columns["camera"] = np.tile([800.0, 0, 128, 0, 800, 128, 0, 0, 1], (64, 1))
        columns["translation_mm"] = np.tile([0.0, 0, 700], (64, 1))
        columns["projection"] = np.array(["orthographic"] * 64)
        for row in range(0, 64, 2):
            ideal.drop(columns, row)
        ideal.write(seen / "data" / f"part-{n}.parquet", columns)
    counted_from("canonical", seen)
    fit = ["fit", seen, "--missing", "exact", "--validation", "0", "--ranks", "2,3,3,3", "--threads", "1"]
    fit += ["--epochs", "4", "--calibrate", extra, "--out", tmp_path / "model"]
    assert run(*fit, "--recipe", "paper", "--partial", monkeypatch=monkeypatch) == 2
    assert "the paper's recipe learns from whole faces alone" in capsys.readouterr().err
    assert run(*fit, "--partial", monkeypatch=monkeypatch) == 0
    assert "128 faces (32 of them partial) of 3 subjects" in capsys.readouterr().err
    others = tmp_path / "others"
    for file in sorted((seen / "data").iterdir()):
        columns = pq.read_table(file).to_pydict()
        columns["subject"] = [f"other {name}" for name in columns["subject"]]
        (others / "data").mkdir(parents=True, exist_ok=True)
        schema = pq.read_schema(file)
        pq.write_table(pa.table(columns, schema=schema), others / "data" / file.name)
    counted_from("canonical", others)
    scores = {}
    for name, options in {"whole": (), "half": ("--partial",)}.items():
        assert run("evaluate", tmp_path / "model", others, *options, "--json", monkeypatch=monkeypatch) == 0
        scores[name] = json.loads(capsys.readouterr().out)
    assert [entry["rows"] for entry in scores["half"]] == [96] * 4
    found = {entry["estimator"]: entry["mae"] for entry in scores["half"]}
    assert found["encoder + heads"] < 0.2 * found["constant zero"]
    assert run("evaluate", tmp_path / "model", extra, "--partial", monkeypatch=monkeypatch) == 1
    assert "no column landmarks_exact; leave out --partial" in capsys.readouterr().err


def test_evaluate_leaves_out_what_was_trained_on(model, dataset, tmp_path, monkeypatch, capsys):
    assert run("evaluate", model, dataset, "--out", tmp_path / "r", "--json", monkeypatch=monkeypatch) == 0
    found = json.loads(capsys.readouterr().out)
    assert [entry["rows"] for entry in found] == [2 * 124] * 4
    # The rows without a face are said, at their angles, and are not in the errors.
    assert [entry["undetected"] for entry in found] == [2] * 4
    assert {f.name for f in (tmp_path / "r").iterdir()} == {
        "errors.md", "errors.csv", "misses.csv", "error_by_interval.png", "error_distribution.png",
    }  # fmt: skip
    with (tmp_path / "r" / "misses.csv").open(newline="") as file:
        lines = list(csv.DictReader(file))
    for angle in ("yaw", "pitch", "roll"):
        mine = [line for line in lines if line["angle"] == angle]
        assert sum(int(line["no_face_found"]) for line in mine) == 2
        assert sum(int(line["rows"]) for line in mine) == 250
    text = (tmp_path / "r" / "errors.md").read_text()
    assert "| yaw | -50 to -33.33 | 50 | 2 (4%) |" in text
    assert "| confidence | rows | mean confidence | share below 5° | mean geodesic |" in text
    assert run("evaluate", model, dataset, "--split", "train", monkeypatch=monkeypatch) == 1
    assert "was trained on every subject" in capsys.readouterr().err


def test_evaluate_says_that_a_dataset_counts_from_another_zero(model, dataset, tmp_path, monkeypatch, capsys):
    from downstream_hpe.prediction.predictor import Predictor

    assert Predictor.load(model).pose_zero == "canonical"
    assert run("evaluate", model, dataset, monkeypatch=monkeypatch) == 0
    assert "--frame" not in capsys.readouterr().err
    (tmp_path / "data").symlink_to(dataset / "data")
    counted_from("source", tmp_path)
    assert run("evaluate", model, tmp_path, monkeypatch=monkeypatch) == 0
    assert "counts angles with --frame source, the model with canonical" in capsys.readouterr().err


def test_datasets_that_count_from_two_zeros_are_not_learned_from(
    dataset, extra, tmp_path, monkeypatch, capsys
):
    other = tmp_path / "other"
    other.mkdir()
    (other / "data").symlink_to(extra / "data")
    arguments = ("fit", dataset, "--out", tmp_path / "m", "--missing", "frontal", "--extra", other)
    for zero, says in (("source", "built with --frame source, but"), (None, "not a readable manifest")):
        counted_from(zero, other)
        if zero is None:
            (other / "manifest.json").write_text("{}")
        assert run(*arguments, monkeypatch=monkeypatch) == 1
        error = capsys.readouterr().err
        assert says in error
        assert error.count("\n") == 1
        assert not (tmp_path / "m").exists()


def test_export_writes_what_predictor_reads(model, dataset, tmp_path, monkeypatch, capsys):
    from downstream_hpe.prediction.predictor import Predictor

    onnx, weights = tmp_path / "p.onnx", tmp_path / "p.safetensors"
    assert run("export", model, "--onnx", onnx, "--weights", weights, monkeypatch=monkeypatch) == 0
    assert onnx.read_bytes() == (model / "model.onnx").read_bytes()
    assert weights.read_bytes() == (model / "network.safetensors").read_bytes()
    Predictor.load(onnx)
    assert run("export", model, "--onnx", onnx, "--json", monkeypatch=monkeypatch) == 0
    written = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert written == [{"file": str(onnx), "bytes": onnx.stat().st_size}]


MISTAKES = {
    "no dataset": (["fit", "nowhere", "--out", "m"], 1, "nowhere: not there; expected a dataset"),
    "three ranks": (
        ["fit", "nowhere", "--out", "m", "--ranks", "5,3,3"],
        2,
        "expected four positive numbers",
    ),
    "other ranks": (["fit", "nowhere", "--out", "m", "--ranks", "5,4,3,3"], 2, "only ID is free"),
    "no model": (["evaluate", "nowhere", "nowhere"], 1, "nowhere: no such model"),
    "a detector of rows": (["evaluate", "m", "d", "--detector", "litert"], 2, "looks at photographs"),
    "nothing to export": (["export", "m"], 2, "nothing to write"),
    "export nothing": (["export", "m", "--onnx", "o"], 1, "not a readable model file"),
}


@pytest.mark.parametrize(("arguments", "code", "says"), MISTAKES.values(), ids=MISTAKES.keys())
def test_mistakes_are_one_clear_line(arguments, code, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert run(*arguments, monkeypatch=monkeypatch) == code
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1


def test_missing_cells_are_refused_until_told(dataset, tmp_path, monkeypatch, capsys):
    assert run("fit", dataset, "--out", tmp_path / "m", monkeypatch=monkeypatch) == 1
    assert "choose --missing keep, exact or frontal" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        ([], "fail"),
        (["--missing", "keep"], "keep"),
        (["--holes", "refuse"], "fail"),
        (["--holes", "mask"], "keep"),
        (["--holes", "exact"], "exact"),
        (["--holes", "rotate"], "frontal"),
    ],
)
def test_holes_is_what_missing_was_called(arguments, expected, tmp_path, monkeypatch):
    """Yesterday's command lines run, with today's words in the model's card."""
    asked = []

    def fit(dataset, folder, settings, note, progress):
        asked.append(settings.missing)
        return fitting.Fitted({})

    monkeypatch.setattr(fitting, "fit", fit)
    assert run("fit", "d", "--out", tmp_path / "m", *arguments, monkeypatch=monkeypatch) == 0
    assert asked == [expected]


def test_the_old_name_is_hidden_and_not_mixed_with_the_new_one(tmp_path, monkeypatch, capsys):
    assert run("fit", "--help", monkeypatch=monkeypatch) == 0
    assert "--holes" not in capsys.readouterr().out
    both = ("fit", "d", "--out", tmp_path / "m", "--missing", "keep", "--holes", "exact")
    assert run(*both, monkeypatch=monkeypatch) == 2
    assert "--holes is the old name of --missing" in capsys.readouterr().err


def test_the_papers_recipe_takes_no_other_poses(dataset, extra, tmp_path, monkeypatch, capsys):
    arguments = ("fit", dataset, "--out", tmp_path / "m", "--recipe", "paper", "--extra", extra)
    assert run(*arguments, monkeypatch=monkeypatch) == 2
    assert "the paper's recipe learns from a grid alone" in capsys.readouterr().err


def test_one_identity_is_refused(dataset, tmp_path, monkeypatch, capsys):
    part = dataset / "data" / "part-0.parquet"
    assert run("fit", part, "--out", tmp_path / "m", "--missing", "keep", monkeypatch=monkeypatch) == 1
    error = capsys.readouterr().err
    assert "subjects" in error or "heads" in error
    assert error.count("\n") == 1


def test_a_grid_too_coarse_is_refused(tmp_path, monkeypatch, capsys):
    axes = (np.array([-50.0, 0, 50]), np.array([-40.0, 0, 40]), np.array([-30.0, 0, 30]))
    for n, face in enumerate(ideal.Faces().draw(8, np.random.default_rng(1))):
        ideal.write(tmp_path / "d" / f"{n}.parquet", ideal.rows(face, f"s{n}", axes))
    assert run("fit", tmp_path / "d", "--out", tmp_path / "m", monkeypatch=monkeypatch) == 1
    error = capsys.readouterr().err
    for angle in ("yaw", "pitch", "roll"):
        assert f"3 {angle} angles on the grid, expected at least 4" in error
        assert f"finer step or a wider range of {angle}" in error
    assert error.count("\n") == 1
    assert not (tmp_path / "m").exists()
