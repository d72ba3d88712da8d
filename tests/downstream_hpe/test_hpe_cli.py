# SPDX-License-Identifier: MIT
"""The command as people meet it, on a tiny dataset: fit, evaluate, export, predict, and mistakes."""

from __future__ import annotations

import csv
import json
import re
import sys

import ideal
import numpy as np
import pytest
from PIL import Image

from downstream_hpe import cli

pytest.importorskip("torch")
pytest.importorskip("onnxruntime")


def run(*arguments, monkeypatch):
    """Run the command in this process; its exit code."""
    monkeypatch.setattr(sys, "argv", ["downstream-hpe", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return stopped.value.code or 0


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """Eight ideal heads, two of them for validation, a few cells not detected."""
    folder = tmp_path_factory.mktemp("dataset")
    for n, face in enumerate(ideal.Faces().draw(8, np.random.default_rng(1))):
        columns = ideal.rows(face, f"s{n}", split="validation" if n > 5 else "train")
        ideal.drop(columns, n)
        ideal.write(folder / "data" / f"part-{n}.parquet", columns)
    return folder


@pytest.fixture(scope="module")
def model(dataset, tmp_path_factory):
    folder = tmp_path_factory.mktemp("model") / "model"
    with pytest.MonkeyPatch.context() as patch:
        code = run("fit", dataset, "--out", folder, "--holes", "mask", "--epochs", "15", "--threads", "1",
                   monkeypatch=patch)  # fmt: skip
    assert code == 0
    return folder


@pytest.mark.parametrize("command", ["fit", "evaluate", "predict", "export"])
def test_every_command_has_help_with_an_example(command, monkeypatch, capsys):
    assert run(command, "--help", monkeypatch=monkeypatch) == 0
    assert f"Example: downstream-hpe {command}" in re.sub(r"\s+", " ", capsys.readouterr().out)


def test_fit_holds_out_the_validation_split(model):
    card = json.loads((model / "model.json").read_text())
    assert card["held_out_subjects"] == ["s6", "s7"]
    assert card["cells_without_landmarks"] == 6
    by_name = {entry["estimator"]: entry for entry in card["held_out"]}
    assert by_name["reconstruction"]["mae"] < 0.05
    assert by_name["encoder + heads"]["mae"] < 0.5 * by_name["constant zero"]["mae"]


def test_evaluate_leaves_out_what_was_trained_on(model, dataset, tmp_path, monkeypatch, capsys):
    assert run("evaluate", model, dataset, "--out", tmp_path / "r", "--json", monkeypatch=monkeypatch) == 0
    found = json.loads(capsys.readouterr().out)
    assert [entry["rows"] for entry in found] == [2 * 124] * 4
    assert {f.name for f in (tmp_path / "r").iterdir()} == {
        "errors.md", "errors.csv", "error_by_interval.png", "error_distribution.png",
    }  # fmt: skip
    assert run("evaluate", model, dataset, "--split", "train", monkeypatch=monkeypatch) == 1
    assert "was trained on every subject" in capsys.readouterr().err


def test_export_writes_what_predictor_reads(model, dataset, tmp_path, monkeypatch, capsys):
    from downstream_hpe.predictor import Predictor

    onnx, weights = tmp_path / "p.onnx", tmp_path / "p.safetensors"
    assert run("export", model, "--onnx", onnx, "--weights", weights, monkeypatch=monkeypatch) == 0
    assert onnx.read_bytes() == (model / "model.onnx").read_bytes()
    assert weights.read_bytes() == (model / "network.safetensors").read_bytes()
    Predictor.load(onnx)


def test_predict_on_a_photograph(model, tmp_path, monkeypatch, capsys):
    pytest.importorskip("mediapipe")
    data = pytest.importorskip("skimage.data")
    Image.fromarray(data.astronaut()).save(tmp_path / "astronaut.png")
    Image.new("RGB", (64, 64)).save(tmp_path / "black.png")
    table = tmp_path / "poses.csv"
    arguments = ("predict", tmp_path, "--model", model, "--out", table, "--draw", tmp_path / "drawn")
    assert run(*arguments, monkeypatch=monkeypatch) == 0
    assert "black.png: no face found" in capsys.readouterr().out
    with table.open(newline="") as file:
        first, second = csv.DictReader(file)
    assert (first["found"], second["found"]) == ("True", "False")
    # The drawing itself is looked at; here only that there is one.
    assert (tmp_path / "drawn" / "astronaut.png").is_file()


MISTAKES = {
    "no dataset": (["fit", "nowhere", "--out", "m"], 1, "nowhere: no .parquet file"),
    "three ranks": (
        ["fit", "nowhere", "--out", "m", "--ranks", "5,3,3"],
        2,
        "expected four positive numbers",
    ),
    "other ranks": (["fit", "nowhere", "--out", "m", "--ranks", "5,4,3,3"], 2, "only ID is free"),
    "no model": (["evaluate", "nowhere", "nowhere"], 1, "not a readable model file"),
    "no picture": (["predict", "nowhere.jpg", "--model", "m"], 2, "there is no such picture"),
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


def test_holes_are_refused_until_told(dataset, tmp_path, monkeypatch, capsys):
    assert run("fit", dataset, "--out", tmp_path / "m", monkeypatch=monkeypatch) == 1
    assert "choose a treatment: mask, exact or rotate" in capsys.readouterr().err


def test_a_grid_too_coarse_is_refused(tmp_path, monkeypatch, capsys):
    axes = (np.array([-50.0, 0, 50]), np.array([-40.0, 0, 40]), np.array([-30.0, 0, 30]))
    for n, face in enumerate(ideal.Faces().draw(8, np.random.default_rng(1))):
        ideal.write(tmp_path / "d" / f"{n}.parquet", ideal.rows(face, f"s{n}", axes))
    assert run("fit", tmp_path / "d", "--out", tmp_path / "m", monkeypatch=monkeypatch) == 1
    assert "3 angles are too few for a cosine" in capsys.readouterr().err
