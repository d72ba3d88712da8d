# SPDX-License-Identifier: GPL-3.0-or-later
"""The ablation: measures and effects against figures computed by hand, pairs, predictions."""

from __future__ import annotations

import csv
import json
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from small_dataset import SMALL_PLAN, TWIN_SHIFT_PX, build_dataset, face_points

from generator import cli
from generator.dataset.ablate.ablation import Ablation, ablate_dataset
from generator.dataset.ablate.effects import effect, mean_interval
from generator.dataset.ablate.measures import POSE, model_measures
from generator.dataset.ablate.predictions import read_predictions
from generator.dataset.proof.verify import verify_dataset
from generator.dataset.show.report.page import report_data
from generator.errors import DatasetError, UsageError
from generator.geometry.camera import Camera
from generator.geometry.rotation import rotation_from_angles
from generator.plan.poses import pose_name

ORTHOGRAPHIC = Camera.square(64, lens_mm=85.0, distance_mm=700.0, projection="orthographic")


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two people, 18 poses each, every row with a twin of two factors."""
    root = tmp_path_factory.mktemp("ablate") / "dataset"
    build_dataset(root, camera=ORTHOGRAPHIC, twins=("jpeg", "noise"))
    return root


def detector(ablation: Ablation, factor: str = "jpeg") -> dict[str, tuple[float, float, float]]:
    [one] = [one for one in ablation.factors if one.factor == factor]
    return {found.measure: (found.plain, found.varied, found.change) for found in one.judged[0].effects}


def test_the_dataset_is_a_sound_one(dataset: Path) -> None:
    report = verify_dataset(dataset)
    assert report.ok, report.text()


def test_figures_are_those_computed_by_hand(dataset: Path) -> None:
    found = ablate_dataset(dataset)
    assert [one.factor for one in found.factors] == ["jpeg", "noise"]
    of_jpeg = found.factors[0]
    assert (of_jpeg.pairs, of_jpeg.identities) == (36, 2)
    # Of 18 poses 2 are missed in a row, and the 6 of large yaw in its twin; of two people.
    [judged] = of_jpeg.judged
    assert (judged.found_neither, judged.found_plain, judged.found_with) == (4, 8, 0)
    assert detector(found)["found"] == pytest.approx((100 * 16 / 18, 100 * 12 / 18, -100 * 4 / 18))
    # Five pixels, against the eyes' distance at the scale of a camera without perspective.
    eyes_mm = np.linalg.norm(face_points()[33] - face_points()[263])
    shift = 100 * np.hypot(*TWIN_SHIFT_PX) / (eyes_mm * ORTHOGRAPHIC.focal_px / 700.0)
    assert detector(found)["landmarks"] == pytest.approx((0, shift, shift), abs=1e-3)
    assert judged.of("landmarks").pairs == 36 - judged.missed == 24
    # A shift turns nothing.
    for measure in POSE:
        assert detector(found)[measure.name][2] == pytest.approx(0, abs=1e-3)


def test_a_twin_that_is_plain_is_the_one_without(dataset: Path, tmp_path: Path) -> None:
    """Of rows that have the factor themselves: the sign is the factor's, not the twin's."""
    root = tmp_path / "dataset"
    build_dataset(root, camera=ORTHOGRAPHIC, twins=("jpeg",), render={"jpeg": 30})
    assert {row["look_jpeg"] for row in pq.read_table(root / "twins", partitioning=None).to_pylist()} == {100}
    there, here = detector(ablate_dataset(dataset)), detector(ablate_dataset(root))
    for measure in ("found", "landmarks"):
        plain, varied, change = there[measure]
        assert here[measure] == pytest.approx((varied, plain, -change))


def test_errors_of_a_model_are_those_of_its_angles() -> None:
    exact = np.array([[10.0, -5.0, 0.0], [20.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    said = exact + np.array([[3.0, 0, 0], [0, -4.0, 0], [np.nan] * 3])
    found = model_measures(said, rotation_from_angles(exact))
    names = [measure.name for measure in POSE]
    assert found[0, names.index("yaw")] == pytest.approx(3)
    assert found[1, names.index("pitch turn")] == pytest.approx(-4)
    assert found[:2, names.index("geodesic")] == pytest.approx([3, 4])
    assert np.isnan(found[2]).all()


def test_people_are_resampled_and_not_images() -> None:
    """Two people who differ: the interval goes from one to the other, however many images they have."""
    subjects = np.array(["a"] * 500 + ["b"] * 500)
    values = np.array([1.0] * 500 + [3.0] * 500)
    assert mean_interval(subjects, values) == (1.0, 3.0)
    assert np.isnan(mean_interval(subjects[:500], values[:500])).all()
    assert mean_interval(subjects, values, seed=3) == mean_interval(subjects, values, seed=3)


def test_the_interval_holds_a_known_effect_as_often_as_it_says() -> None:
    """Effects of 2, of people who differ from each other; 0.936 is what 30 of them allow percentiles."""
    rng = np.random.default_rng(0)
    people, images, trials, held = 30, 8, 300, 0
    subjects = np.repeat([f"s{k}" for k in range(people)], images)
    for _ in range(trials):
        own = rng.normal(2, 1, people).repeat(images)
        low, high = mean_interval(subjects, own + rng.normal(0, 0.5, people * images))
        held += low <= 2 <= high
        assert high - low > 0.4, "as if images were independent, it would be a third as wide"
    assert 0.9 < held / trials < 0.97


def test_pairs_without_a_value_are_left_out() -> None:
    nan = float("nan")
    subjects = np.array(["a", "a", "b", "b"])
    found = effect("x", "", subjects, np.array([1.0, nan, 3, 4]), np.array([2.0, 9, nan, 6]))
    assert (found.pairs, found.plain, found.varied, found.change) == (2, 2.5, 4.0, 1.5)
    nothing = effect("x", "", subjects, np.full(4, nan), np.ones(4))
    assert nothing.pairs == 0 and np.isnan(nothing.change) and not nothing.is_sure


def predictions(root: Path, file: Path, turn: float, column: str = "sample_id") -> Path:
    """A model that is right on rows and turned on twins of jpeg, and says nothing at one pose."""
    lines = []
    for subject in ("s1", "s2"):
        for pose in SMALL_PLAN.angles_deg.tolist():
            for twin in ("", "~jpeg", "~noise"):
                name = f"{subject}/neutral/{pose_name(*pose)}{twin}"
                if column == "input":
                    name = f"{root}/images/{name}.png"
                yaw = pose[0] + turn * (twin == "~jpeg")
                empty = twin == "~noise" and pose == [0, 0, 0]
                lines.append([name, *(["", "", ""] if empty else [yaw, pose[1], pose[2]])])
    header = [column, "yaw_deg", "pitch_deg", "roll_deg"]
    if file.suffix == ".parquet":
        values = [[None if value == "" else value for value in part] for part in zip(*lines, strict=True)]
        pq.write_table(pa.table(dict(zip(header, values, strict=True))), file)
        return file
    with file.open("w", newline="") as stream:
        csv.writer(stream).writerows([header, *lines])
    return file


@pytest.mark.parametrize(
    ("name", "column"), [("model.csv", "sample_id"), ("model.parquet", "sample_id"), ("model.csv", "input")]
)
def test_what_a_model_said(dataset: Path, tmp_path: Path, name: str, column: str) -> None:
    file = predictions(dataset, tmp_path / name, 5.0, column)
    jpeg, noise = ablate_dataset(dataset, [read_predictions(file)]).factors
    model = jpeg.judged[1]
    assert model.estimator == "model" and model.missed == 0
    assert model.of("yaw").change == pytest.approx(5) and model.of("yaw turn").change == pytest.approx(5)
    assert model.of("pitch").change == pytest.approx(0, abs=1e-9)
    assert noise.judged[1].found_plain == 2
    assert noise.judged[1].of("geodesic").change == pytest.approx(0, abs=1e-5)


def headturn(monkeypatch: pytest.MonkeyPatch, *arguments: str) -> int:
    monkeypatch.setattr(sys, "argv", ["headturn", *arguments])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    return int(stopped.value.code or 0)


def test_the_command(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    out = tmp_path / "figures.csv"
    assert headturn(monkeypatch, "ablate", str(dataset), "--out", str(out)) == 0
    said = capsys.readouterr().out
    assert "jpeg, detector: no face in 12 of 36 pairs: 8 only with it, 0 only without, 4 in both" in said
    assert "88.89 → 66.67" in said and "-22.22" in said
    with out.open() as stream:
        lines = [*csv.DictReader(stream)]
    [found] = [x for x in lines if (x["factor"], x["measure"]) == ("jpeg", "found")]
    assert found["change"] == "-22.2222" and (found["pairs"], found["identities"]) == ("36", "2")
    assert headturn(monkeypatch, "ablate", str(dataset), "--json") == 0
    values = json.loads(capsys.readouterr().out)
    assert [one["factor"] for one in values["factors"]] == ["jpeg", "noise"]
    assert (dataset / "ablation.csv").read_text() == out.read_text()
    assert verify_dataset(dataset).ok


def test_a_dataset_without_twins(tmp_path: Path) -> None:
    build_dataset(tmp_path / "dataset")
    with pytest.raises(DatasetError, match="has no twins; build it with --twins"):
        ablate_dataset(tmp_path / "dataset")
    assert report_data(tmp_path / "dataset", lambda rows: None)["twins"] is None


def test_the_report_shows_the_same_figures_and_pairs(dataset: Path) -> None:
    shown = report_data(dataset, lambda rows: None)["twins"]
    for factor, figures in zip(shown["factors"], ablate_dataset(dataset).as_dict()["factors"], strict=True):
        pairs = factor.pop("examples")
        assert factor == figures
        assert [pair["plain"]["name"] for pair in pairs] == [
            f"{subject}/neutral/y+0_p+0_r+0" for subject in ("s1", "s2")
        ]
        for pair in pairs:
            assert pair["with"]["name"] == f"{pair['plain']['name']}~{factor['factor']}"
            assert pair["with"]["src"].startswith("data:image/jpeg")


def test_what_could_not_be_made_is_in_no_pair(tmp_path: Path) -> None:
    """Or the effect of glasses would be that of glasses on some, and of none on others."""
    root = tmp_path / "dataset"
    build_dataset(root, twins=("glasses",))
    for file in (root / "twins").rglob("*.parquet"):
        table = pq.read_table(file, partitioning=None)
        place = table.schema.get_field_index("look_left_out")
        reasons = ["hair: too tight; glasses: no ears"] * 3 + ["hair: too tight"] * (len(table) - 3)
        pq.write_table(table.set_column(place, table.schema.field(place), pa.array(reasons)), file)
    [one] = ablate_dataset(root).factors
    assert (one.pairs, one.not_made) == (36 - 6, 6)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("sample_id,yaw_deg,pitch_deg\na,1,2\n", "no column roll_deg"),
        ("name,yaw_deg,pitch_deg,roll_deg\na,1,2,3\n", "no column sample_id"),
        ("sample_id,yaw_deg,pitch_deg,roll_deg\na/b/c,1,2,x\n", "no table of predictions"),
        ("sample_id,yaw_deg,pitch_deg,roll_deg\na/b/c,1,2,3\na/b/c,1,2,3\n", "stands in it twice"),
        ("", "no table of predictions"),
        ("sample_id,yaw_deg,pitch_deg,roll_deg\na/b/c,1,2,3\n", "36 of 36 images are not in it, such as s1/"),
        (None, "no table of predictions"),
    ],
)
def test_predictions_that_are_none(dataset: Path, tmp_path: Path, content: str | None, said: str) -> None:
    file = tmp_path / "model.csv"
    if content is not None:
        file.write_text(content)
    with pytest.raises(UsageError, match=said) as caught:
        ablate_dataset(dataset, [read_predictions(file)])
    assert "\n" not in str(caught.value)
