# SPDX-License-Identifier: MIT
"""The package as a program meets it: its names, pictures in every form, what is said of others."""

from __future__ import annotations

import doctest
import importlib
import pickle
import shutil
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import downstream_hpe
from downstream_hpe import HpeError, Pose, Predictor, cli, draw
from downstream_hpe.errors import DataError, ModelError, UsageError
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.prediction.given import rgb_of
from downstream_hpe.prediction.predictor import MODELS

ROOT = Path(__file__).resolve().parents[2]
PICTURE = np.random.default_rng(0).integers(0, 256, (40, 60, 3), dtype=np.uint8)


@pytest.fixture(scope="module")
def predictor() -> Predictor:
    pytest.importorskip("onnxruntime")
    return Predictor()


def faces_before(count: int = 1) -> np.ndarray:
    """Landmarks [count, 468, 3] in pixels of a picture of 500 x 400."""
    return mean_head()[None] * np.full((count, 1, 1), 0.8) + [250, 200, 0]


def run(*arguments: object, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(sys, "argv", ["downstream-hpe", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return int(stopped.value.code or 0)


def test_the_version_is_that_of_the_package_and_typed_nowhere(monkeypatch, capsys):
    assert downstream_hpe.__version__ == version("headturn")
    assert run("--version", monkeypatch=monkeypatch) == 0
    assert capsys.readouterr().out == f"downstream-hpe {version('headturn')}\n"
    assert "__version__" in dir(downstream_hpe)
    for file in (*(ROOT / "downstream_hpe").rglob("*.py"), ROOT / "pyproject.toml"):
        assert f'"{version("headturn")}"' not in file.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["given", "pose", "predictor", "drawing"])
def test_examples_run(name):
    pytest.importorskip("onnxruntime")
    found = doctest.testmod(importlib.import_module(f"downstream_hpe.prediction.{name}"))
    assert found.attempted and not found.failed


def test_a_picture_in_every_form_is_the_same(tmp_path):
    image = Image.fromarray(PICTURE)
    image.save(tmp_path / "p.png")
    opaque = np.dstack([PICTURE, np.full(PICTURE.shape[:2], 9, np.uint8)])
    forms = [
        *(PICTURE, np.asfortranarray(PICTURE), opaque, image, Image.fromarray(opaque)),
        *(tmp_path / "p.png", str(tmp_path / "p.png")),
    ]
    for form in forms:
        rgb = rgb_of(form)
        assert rgb.flags.c_contiguous and rgb.dtype == np.uint8
        np.testing.assert_array_equal(rgb, PICTURE)
    for bgr in (PICTURE[..., ::-1], np.ascontiguousarray(PICTURE[..., ::-1])):
        np.testing.assert_array_equal(rgb_of(bgr, bgr=True), PICTURE)
    # Of files and of Pillow's pictures the order is known.
    np.testing.assert_array_equal(rgb_of(tmp_path / "p.png", bgr=True), PICTURE)
    grey = PICTURE[..., 0]
    for form in (grey, grey[..., None], Image.fromarray(grey)):
        np.testing.assert_array_equal(rgb_of(form), np.dstack([grey] * 3))


def test_a_picture_of_pillow_is_turned_as_its_file_is(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6  # a quarter clockwise
    Image.fromarray(PICTURE).save(tmp_path / "turned.png", exif=exif)
    with Image.open(tmp_path / "turned.png") as image:
        np.testing.assert_array_equal(rgb_of(image), rgb_of(tmp_path / "turned.png"))
    assert rgb_of(tmp_path / "turned.png").shape == (60, 40, 3)


NO_PICTURES = {
    "none": (None, "got None, which cv2.imread gives where there is no picture"),
    "an empty path": ("", "expected a picture: its path is ''"),
    "no file": ("nowhere.png", "nowhere.png: there is no such picture"),
    "a number": (3, "got int"),
    "bytes": (b"photo.jpg", "got bytes"),
    "a list": ([PICTURE], "got a list; give one picture at a time"),
    "floats": (PICTURE / 255, r"got float64 \(40, 60, 3\); of 0 to 1 it is \(255 \* picture\)"),
    "16 bits": (PICTURE.astype(np.uint16), r"got uint16 \(40, 60, 3\); of 16 bits"),
    "empty": (PICTURE[:0], r"expected a uint8 picture \[H, W, 3\], RGB, .* got uint8 \(0, 60, 3\)$"),
    "two channels": (PICTURE[..., :2], r"got uint8 \(40, 60, 2\)"),
    "channels first": (np.moveaxis(PICTURE, -1, 0), "channels come last"),
    "a batch": (PICTURE[None], "give one picture at a time"),
    "a row": (PICTURE[0, 0], r"got uint8 \(3,\)"),
    "nothing of Pillow": (Image.new("RGB", (0, 9)), "0 x 9 pixels"),
}


@pytest.mark.parametrize(("given", "says"), NO_PICTURES.values(), ids=NO_PICTURES.keys())
def test_what_is_no_picture_is_refused_in_one_line(predictor, given, says):
    for ask in (predictor.predict, lambda picture: draw(picture, None)):
        with pytest.raises(DataError, match=says) as caught:
            ask(given)
        assert "\n" not in str(caught.value)
    with pytest.raises(DataError, match=says.replace("RGB", "BGR")):
        predictor.from_image(given)


def test_other_arguments_that_are_none(predictor):
    for faces in (0, -1, "3", 1.5, None, True):
        with pytest.raises(UsageError, match=r"faces: expected a number from 1 on, got"):
            predictor.predict(PICTURE, faces=faces)
    with pytest.raises(UsageError, match=r"camera: expected a Camera, .* got ndarray"):
        predictor.from_landmarks(faces_before(), np.eye(3))
    for landmarks in (None, [[1], [2, 3]], faces_before().astype(object)):
        with pytest.raises(DataError, match="expected landmarks"):
            predictor.from_landmarks(landmarks)
    with pytest.raises(UsageError, match="model: expected a name or a path, got NoneType"):
        Predictor(None)


def test_a_pose_says_what_it_is(predictor):
    pose = predictor.from_landmarks(faces_before())
    assert len(pose) == 1 and pose.in_range.all() and pose.landmarks.shape == (1, 468, 3)
    assert repr(pose).startswith("Pose(1 face: yaw ") and "\n" not in repr(pose)
    many = predictor.from_landmarks(faces_before(10))
    assert repr(many).splitlines()[0] == "Pose(10 faces:" and repr(many).endswith("\n  and 2 more)")
    assert repr(predictor.from_landmarks(faces_before(0))) == "Pose(0 faces)"
    assert pose == predictor.from_landmarks(faces_before()) and pose != many and pose != "pose"
    assert pose == pickle.loads(pickle.dumps(pose))
    outside = Pose(np.array([[80.0, 0, 0]]), np.eye(3)[None], in_range=np.array([False]))
    assert (
        repr(outside) == "Pose(1 face: yaw +80.0, pitch +0.0, roll +0.0 degrees, outside the trained range)"
    )


def test_draw_gives_a_picture_and_leaves_its_own_alone(predictor, tmp_path):
    picture = np.full((400, 500, 3), 128, np.uint8)
    pose = predictor.from_landmarks(faces_before())
    drawn = draw(picture, pose)
    assert drawn.size == (500, 400) and (picture == 128).all()
    assert (np.asarray(drawn) != 128).any(axis=-1).sum() > 500
    image = Image.fromarray(picture)
    image.save(tmp_path / "p.png")
    for same in (image, tmp_path / "p.png", picture[..., 0]):
        np.testing.assert_array_equal(np.asarray(draw(same, pose)), np.asarray(drawn))
    assert (np.asarray(image) == 128).all()
    # Without a face it is the picture; read-only arrays are taken, and very long ones not enlarged.
    picture.flags.writeable = False
    assert (np.asarray(draw(picture, None)) == 128).all()
    assert draw(np.zeros((1, 5000), np.uint8), None).size == (5000, 1)


def test_draw_says_what_cannot_be_drawn(predictor):
    picture = np.zeros((400, 500, 3), np.uint8)
    pose = predictor.from_landmarks(faces_before())
    bare = Pose(pose.ypr_deg, pose.rotation)
    apart = predictor.from_landmarks(faces_before() / 500)
    for given, says in (
        (picture, "expected the Pose that predict gave of it, got ndarray"),
        (bare, "says not where its faces are"),
        (apart, "are no pixels of a picture of 500 x 400"),
    ):
        with pytest.raises(HpeError, match=says):
            draw(picture, given)
    with pytest.raises(HpeError, match="are no pixels of a picture of 90 x 20"):
        draw(picture[:20, :90], pose)


def test_a_predictor_can_be_pickled_and_says_what_it_is(predictor, tmp_path, monkeypatch):
    again = pickle.loads(pickle.dumps(Predictor(threads=2, detector="litert")))
    assert repr(again).startswith("<Predictor headturn: yaw -50 to 50, ")
    assert repr(again).endswith(" degrees; faces by litert>")
    assert again.from_landmarks(faces_before()) == predictor.from_landmarks(faces_before())
    # By a path it goes to another current folder, and says so where the file is gone.
    shutil.copy(MODELS / "headturn.onnx", tmp_path / "m.onnx")
    monkeypatch.chdir(tmp_path)
    kept = pickle.dumps(Predictor("m.onnx"))
    monkeypatch.chdir(ROOT)
    assert f"<Predictor {tmp_path / 'm.onnx'}: " in repr(pickle.loads(kept))
    (tmp_path / "m.onnx").unlink()
    with pytest.raises(ModelError, match=r"m\.onnx: no such model"):
        pickle.loads(kept)
    with Predictor() as opened:
        assert opened.from_landmarks(faces_before()) == predictor.from_landmarks(faces_before())


def test_export_of_a_model_that_comes_along(tmp_path, monkeypatch, capsys):
    file = tmp_path / "pose.onnx"
    assert run("export", "headturn", "--onnx", file, monkeypatch=monkeypatch) == 0
    card = tmp_path / "pose.onnx.md"
    assert [line.partition(": ")[0] for line in capsys.readouterr().out.splitlines()] == [
        str(file),
        str(card),
    ]
    assert file.read_bytes() == (MODELS / "headturn.onnx").read_bytes()
    assert "## Licence\n\nMIT" in card.read_text(encoding="utf-8")
    for options in (["--weights", tmp_path / "w"], ["--weights", tmp_path / "w", "--onnx", file], []):
        assert run("export", "headturn", *options, monkeypatch=monkeypatch) == 2
        assert capsys.readouterr().err.count("\n") == 1
