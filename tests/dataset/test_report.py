# SPDX-License-Identifier: GPL-3.0-or-later
"""The report: a known error is recovered, and what a browser shows is what the table says."""

from __future__ import annotations

import json
import re
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import small_dataset
from known_error import REGIONS, SHIFT
from small_dataset import CAMERA, HEADS, face_points

from generator import cli
from generator.dataset.show.report.page import page_text, report_data, write_report
from generator.errors import DatasetError
from generator.plan.poses import PosePlan, grid_plan


def data_of(root: Path) -> dict:
    """Of the page, with what it says of the first detector beside the rest."""
    data = report_data(root, lambda _: None)
    return {**data, **data["detectors"][0]}


def cell(data: dict, yaw: float, pitch: float, roll: float) -> int:
    axes = data["axes"]
    i, j, k = (axes[n].index(v) for n, v in zip(("yaw", "pitch", "roll"), (yaw, pitch, roll), strict=True))
    return (i * len(axes["pitch"]) + j) * len(axes["roll"]) + k


def test_the_atlas_recovers_a_known_error(known):
    data = data_of(known)
    assert data["picks"] == ["all heads", "s1 / neutral", "s2 / neutral"]
    for pick, times in ((1, 1), (2, 2)):
        regions = dict(zip(data["regions"], data["maps"][pick]["regions"], strict=True))
        here = cell(data, -30, 20, 10)
        for name, (dx, dy) in SHIFT.items():
            assert regions[name]["dx"][here] == pytest.approx(times * dx, abs=1e-3)
            assert regions[name]["dy"][here] == pytest.approx(times * dy, abs=1e-3)
            assert regions[name]["distance"][here] == pytest.approx(times * np.hypot(dx, dy), abs=1e-3)
            assert regions[name]["spread"][here] == pytest.approx(0, abs=1e-2)
        assert regions["brows"]["distance"][here] == pytest.approx(0, abs=1e-3)
    # Two heads, off by one and two times: the mean is 1.5 times, the spread half of the step.
    eyes = data["maps"][0]["regions"][data["regions"].index("eyes")]
    assert eyes["dx"][here] == pytest.approx(3.0, abs=1e-3)
    assert eyes["spread"][here] == pytest.approx(np.hypot(1.0, 0.5), abs=1e-3)
    assert eyes["rows"][here] == 2
    missed = cell(data, 30, 20, 0)
    assert eyes["dx"][missed] is None and eyes["rows"][missed] == 0
    assert data["maps"][0]["detected"][missed] == 0 and data["maps"][0]["rows"][missed] == 2


def test_overall_means_are_the_tables(known):
    data, table = data_of(known), pq.read_table(known / "data").to_pylist()
    assert data["rows"] == len(table) == 90 and data["detected"] == sum(r["detected"] for r in table) == 82
    distances = []
    for row in table:
        if row["detected"]:
            mm = np.array(row["landmarks_exact"]).reshape(468, 3)
            image = mm @ np.array(row["camera"]).reshape(3, 3).T
            found = np.array(row["landmarks"]).reshape(468, 3)[:, :2]
            distances.append(np.nanmean(np.linalg.norm(found - image[:, :2] / image[:, 2:], axis=1)))
    assert data["overall"]["compared"] == len(distances)
    assert data["overall"]["distance_px"] == pytest.approx(np.mean(distances), abs=1e-4)
    mm_per_px = CAMERA.distance_mm / CAMERA.focal_px
    assert data["overall"]["distance_mm"] == pytest.approx(np.mean(distances) * mm_per_px, abs=1e-4)
    assert data["heads"][0]["distance_px"] == pytest.approx(np.mean(distances[:41]), abs=1e-3)


def test_a_known_turn_of_the_detector_is_recovered_as_degrees(tmp_path, build, monkeypatch):
    """Landmarks of a head turned 3 more degrees to image left: yaw +3, whatever the pose."""
    original, turn = small_dataset.unit_rows, (3.0, 0.0, 0.0)

    def turned(head, plan, chosen, camera=CAMERA):
        rows = original(head, plan, chosen, camera)
        more = PosePlan(plan.angles_deg + turn, plan.indices, plan.kind)
        found = original(head, more, chosen, camera).landmarks
        return replace(rows, landmarks=np.where(rows.detected[:, None, None], found, np.nan))

    monkeypatch.setattr(small_dataset, "unit_rows", turned)
    monkeypatch.setattr(small_dataset, "face_anchors", face_points)
    build(tmp_path / "d", plan=grid_plan((-20, 20, 20), (-20, 20, 20), (-10, 10, 10)))
    data = data_of(tmp_path / "d")
    for here in (cell(data, 0, 0, 0), cell(data, -20, 20, -10), cell(data, 20, -20, 10)):
        everyone = data["maps"][0]
        assert everyone["turn"][0][here] == pytest.approx(3, abs=0.35)  # perspective is not a rotation
        assert everyone["turn"][1][here] == pytest.approx(0, abs=0.35)
        assert everyone["turn"][2][here] == pytest.approx(0, abs=0.35)
        assert everyone["geodesic"][here] == pytest.approx(3, abs=0.35)
        assert everyone["turn_spread"][0][here] == pytest.approx(0, abs=1e-3)


@pytest.mark.slow
def test_parts_of_the_face_are_mediapipes():
    connections = pytest.importorskip("mediapipe").solutions.face_mesh_connections

    def points(*names: str) -> set[int]:
        return {k for name in names for line in getattr(connections, name) for k in line}

    assert set(REGIONS["eyes"].tolist()) == points("FACEMESH_LEFT_EYE", "FACEMESH_RIGHT_EYE")
    assert set(REGIONS["brows"].tolist()) == points("FACEMESH_LEFT_EYEBROW", "FACEMESH_RIGHT_EYEBROW")
    assert set(REGIONS["mouth"].tolist()) == points("FACEMESH_LIPS")
    assert set(REGIONS["jaw and oval"].tolist()) == points("FACEMESH_FACE_OVAL")
    assert set(REGIONS["nose"].tolist()) == points("FACEMESH_NOSE")


def test_without_exact_landmarks_the_page_says_why(tmp_path, build, monkeypatch):
    monkeypatch.setattr(small_dataset, "face_anchors", lambda: np.full((468, 3), np.nan))
    build(tmp_path / "d", "none", heads=tuple(replace(head, anchor_absent=468) for head in HEADS))
    data = data_of(tmp_path / "d")
    assert "No head of this dataset has exact landmarks" in data["why_no_atlas"]
    assert data["overall"]["compared"] == 0 and data["sheet"] is None
    write_report(tmp_path / "d", tmp_path / "r.html")


def test_poses_off_the_grid_are_binned(tmp_path, build):
    from generator.plan.poses import uniform_plan

    build(tmp_path / "d", plan=uniform_plan(40, 1, (-30, 30), (-20, 20), (-10, 10)))
    data = data_of(tmp_path / "d")
    assert data["binned"] and set(data["axes"]["yaw"]) <= set(np.arange(-30.0, 31, 10))
    assert sum(data["maps"][0]["rows"]) == 80


def test_times_come_from_the_log(tmp_path, build):
    from generator.dataset.show.report.facts import timings

    log = tmp_path / "build.log"
    assert timings(log) is None
    log.write_text(
        "2026-01-01T00:00:00Z images: 4\n"
        '2026-01-01T00:00:01Z unit {"seconds": {"render": 1.5, "detect": 0.5}}\n'
        '2026-01-01T00:00:02Z unit {"seconds": {"render": 2.0}}\n'
    )
    assert timings(log) == {"render": 3.5, "detect": 0.5}


def test_the_page_carries_everything_and_nothing_of_the_network(known, tmp_path):
    size = write_report(known, tmp_path / "r.html")
    text = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert size == len(text.encode()) < 3_000_000
    without_namespaces = text.replace("http://www.w3.org/2000/svg", "")
    assert not re.search(r"https?://|@import|<link|src=\"(?!data:)|url\(", without_namespaces)
    assert text.count("</script>") == 2  # the licence's is escaped
    assert page_text(report_data(known, lambda _: None)) == text  # the same dataset, the same bytes


def test_many_heads_keep_the_page_small(known):
    from generator.dataset.format.dataset_poses import DatasetPoses
    from generator.dataset.show.report.atlas import NUMBERS, Atlas
    from generator.dataset.show.report.cells import PoseCells
    from generator.plan.pose_plans import PosePlans

    heads = [replace(HEADS[0], subject=f"p{k}") for k in range(2000)]
    atlas = Atlas(heads, PoseCells.of(DatasetPoses(heads, PosePlans(grid_plan()))))
    assert 10 < len(atlas.heads) < 50
    numbers = re.findall(r"\d+|null", json.dumps(atlas.as_dict()["maps"]))
    assert len(numbers) < 1.1 * NUMBERS


def test_a_part_deleted_by_hand(known, tmp_path):
    shutil.copytree(known, tmp_path / "d")
    next((tmp_path / "d" / "data").rglob("*.parquet")).unlink()
    with pytest.raises(DatasetError, match="headturn verify"):
        write_report(tmp_path / "d", tmp_path / "r.html")
    assert not (tmp_path / "r.html").exists()


def test_the_command(known, tmp_path, monkeypatch, capsys):
    page = tmp_path / "r.html"
    monkeypatch.setattr(sys, "argv", ["headturn", "report", str(known), "--out", str(page), "--json"])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    assert not stopped.value.code
    assert json.loads(capsys.readouterr().out) == {"page": str(page), "bytes": page.stat().st_size}
