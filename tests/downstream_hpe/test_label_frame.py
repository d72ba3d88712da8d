# SPDX-License-Identifier: MIT
"""evaluate: raw, without a constant rotation, and what the labels' own points say; protocols by name."""

from __future__ import annotations

import json
import sys

import ideal
import numpy as np
import pytest
from PIL import Image
from scipy.io import savemat

from downstream_hpe import cli
from downstream_hpe.errors import DataError, UsageError
from downstream_hpe.evaluation.constant import markdown
from downstream_hpe.evaluation.estimators import rigid_fit
from downstream_hpe.evaluation.label_frame import OWN_POINTS, label_frames, own_points_fit
from downstream_hpe.evaluation.photographs import LeftOut, aflw2000
from downstream_hpe.evaluation.protocols import PROTOCOLS, check_protocol, under
from downstream_hpe.evaluation.scored_rows import Measured
from downstream_hpe.evaluation.scores import evaluate
from downstream_hpe.geometry.face_mesh import IBUG_INNER
from downstream_hpe.geometry.rotation import angles_from_rotation, rotation_from_angles
from downstream_hpe.tables.rows import Rows, read_exact
from generator.landmarks.topology import FACE_MESH

LABELS = rotation_from_angles([0, 3, 0])
"""The labels' zero, as seen from the face's own."""


def measured(count: int = 40, own: int = 468) -> tuple[Measured, np.ndarray]:
    """Turned faces whose labels count from another zero, 5 missed; and the face."""
    rng = np.random.default_rng(2)
    face = ideal.Faces().draw(1, rng)
    ypr = rng.uniform(-1, 1, size=(count, 3)) * [60, 40, 30]
    seen = rotation_from_angles(ypr)
    landmarks = ideal.turned(face, ypr).astype(np.float32)
    points = 3 * landmarks + 7
    if own == 68:
        points = np.concatenate([rng.normal(size=(count, 17, 3)), points[:, list(IBUG_INNER)]], axis=1)
    label = seen @ LABELS
    names = np.array([f"s{n:02d}" for n in range(count)])
    rows = Rows(names, names, angles_from_rotation(label), label, landmarks, 5)
    return Measured(
        rows, np.tile([[0.0, 0, 0], [55, 0, 0], [0, 0, 98], [0, 0, 120], [1, 1, 1]], 1), 0, points
    ), face[0]


@pytest.mark.parametrize("own", [468, 68])
def test_every_estimator_has_its_constant_and_the_labels_their_own(own):
    given, face = measured(own=own)
    given.own_points[0] = np.nan
    fitted = rigid_fit(face)(given.rows.landmarks)
    framed = label_frames([evaluate("rigid", fitted, given.rows.rotation)], given, face, 4)
    assert [e.name for e, _ in framed] == ["rigid", OWN_POINTS]
    assert [e.count for e, _ in framed] == [40, 39]
    for e, c in framed:
        assert e.geodesic == pytest.approx(3, abs=1e-3)
        np.testing.assert_allclose(c.ypr_deg, [0, -3, 0], atol=1e-3)
        assert (c.geodesic, c.folds) == (pytest.approx(0, abs=1e-3), 4)
    text = markdown(framed)
    assert "MAE without, 4 folds" in text
    assert "| -3.0 (-3.0 to -3.0) |" in text
    # Without a face to fit, or without points, there is only the estimator.
    assert len(label_frames([framed[0][0]], given, None, 4)) == 1
    assert own_points_fit(face, np.full((2, 468, 3), np.nan)) is None


def test_the_inner_points_are_those_of_the_exports():
    assert FACE_MESH.ibug_68 is not None
    assert tuple(FACE_MESH.ibug_68.indices)[17:] == IBUG_INNER


def test_own_points_of_an_export_are_turned_as_its_labels_are(tmp_path):
    """z of pt3d_68 is towards the viewer: read the other way the face would be mirrored, and not fit."""
    given, face = measured(6)
    for n, pixels in enumerate(given.rows.landmarks):
        points = np.zeros((3, 68))
        points[:, 17:] = (pixels[list(IBUG_INNER)] * [1, 1, -1]).T
        yaw, pitch, roll = np.deg2rad(given.rows.ypr_deg[n])
        savemat(
            tmp_path / f"{n}.mat",
            {"Pose_Para": np.array([[pitch, yaw, roll, 0, 0, 0, 1]]), "pt3d_68": points},
        )
        Image.new("RGB", (8, 6)).save(tmp_path / f"{n}.jpg")
    read = np.stack([photograph.points for photograph in aflw2000(tmp_path, LeftOut())])
    fitted = rotation_from_angles(own_points_fit(face, read))
    np.testing.assert_allclose(fitted @ LABELS, given.rows.rotation, atol=1e-5)


def test_protocols_count_what_they_say():
    given, _ = measured()
    notes: list[str] = []
    paper = under("paper-bounds", "headturn", given, "d", notes.append)
    assert (np.abs(paper.rows.ypr_deg) <= [50, 40, 30]).all()
    assert len(paper.rows) == len(paper.own_points) < 40
    assert len(paper.missed_deg) == 2
    assert notes == [f"{40 - len(paper.rows)} rows outside 50, 40, 30 degrees left out"]
    notes.clear()
    assert len(under("99", "aflw2000", given, "d", notes.append).missed_deg) == 4
    assert notes == ["44 labels, and protocol 99 has 1969: not comparable with the papers"]
    assert len(under("biwi-15677", "biwi", given, "d", notes.append).missed_deg) == 5
    for name, layout in (("fsanet-biwi", "biwi"), ("biwi-15677", "biwi-npz"), ("biwi-15677", "headturn")):
        with pytest.raises(UsageError, match=f"--protocol {name} is about --format"):
            check_protocol(name, layout)
    for name in PROTOCOLS:
        check_protocol(name, (*PROTOCOLS[name].formats, "headturn")[0])
    far = Measured(given.rows.take(np.abs(given.rows.ypr_deg[:, 0]) > 50), given.missed_deg)
    with pytest.raises(DataError, match="no pose within 50, 40, 30 degrees"):
        under("paper-bounds", "headturn", far, "d", notes.append)


@pytest.fixture
def dataset(tmp_path):
    """Three ideal heads with exact landmarks, one cell missed."""
    for n, face in enumerate(ideal.Faces().draw(3, np.random.default_rng(1))):
        columns = ideal.rows(face, f"s{n}")
        columns["landmarks_exact"] = columns["landmarks"].copy()
        ideal.drop(columns, 7)
        ideal.write(tmp_path / "d" / f"{n}.parquet", columns)
    np.savetxt(
        tmp_path / "face.csv", _faced(ideal.Faces().draw(1, np.random.default_rng(1))[0]), delimiter=","
    )
    return tmp_path / "d"


def _faced(face):
    face[10, 1], face[152, 1], face[1, 2] = -6, 6, -6
    return face


def test_evaluate_prints_both_and_says_them_to_machines(dataset, monkeypatch, capsys):
    pytest.importorskip("onnxruntime")
    assert read_exact(dataset).shape == (3 * 124, 468, 3)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["downstream-hpe", "evaluate", "headturn", str(dataset), *arguments])
        with pytest.raises(SystemExit) as stopped:
            cli.main()
        return stopped.value.code or 0

    face = ("--reference", str(dataset.parent / "face.csv"))
    assert run(*face, "--protocol", "99", "--folds", "3") == 0
    text = capsys.readouterr().out
    assert f"| {OWN_POINTS} | 372 |" in text
    assert "MAE without, 3 folds" in text
    assert run(*face, "--json") == 0
    found = {entry["estimator"]: entry for entry in json.loads(capsys.readouterr().out)}
    assert set(found) >= {OWN_POINTS, "encoder + heads", "rigid fit to reference face"}
    assert all(entry["undetected"] == 3 for entry in found.values())
    assert all(len(entry["constant_deg"]) == 3 for entry in found.values())
    assert found[OWN_POINTS]["geodesic"] == pytest.approx(found["rigid fit to reference face"]["geodesic"])
    assert run("--protocol", "99", "--all") == 2
    assert "give one of them" in capsys.readouterr().err
    assert run("--protocol", "fsanet-biwi") == 2
    assert "is about --format biwi-npz" in capsys.readouterr().err
