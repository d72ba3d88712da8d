# SPDX-License-Identifier: GPL-3.0-or-later
"""The report: a known error is recovered, and what a browser shows is what the table says."""

from __future__ import annotations

import base64
import html
import json
import re
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import small_dataset
from scipy.spatial.transform import Rotation
from small_dataset import CAMERA, HEADS, face_points

from generator import cli
from generator.dataset.show.report.page import page_text, report_data, write_report
from generator.dataset.show.report.regions import REGIONS
from generator.errors import DatasetError
from generator.plan.poses import PosePlan, grid_plan

PLAN = grid_plan((-30, 30, 15), (-20, 20, 20), (-10, 10, 10))
SHIFT = {"eyes": (2.0, -1.0), "mouth": (0.0, 3.0)}
"""Known errors, pixels right and down, added to what the detector says of s1; s2 gets twice as much."""


def data_of(root: Path) -> dict:
    return report_data(root, lambda _: None)


@pytest.fixture(scope="module")
def known(tmp_path_factory, build) -> Path:
    """A dataset whose detector is off by SHIFT, and otherwise exact."""
    root = tmp_path_factory.mktemp("report") / "dataset"
    original = small_dataset.unit_rows

    def shifted(head, plan, chosen, camera=CAMERA):
        rows = original(head, plan, chosen, camera)
        landmarks = rows.landmarks.copy()
        for name, (dx, dy) in SHIFT.items():
            landmarks[:, REGIONS[name], :2] += np.array([dx, dy]) * (1 if head.subject == "s1" else 2)
        # One more miss, so that yaw and pitch cannot be taken for each other.
        missed = (rows.angles_deg == (-15, 0, 10)).all(axis=1)
        landmarks[missed] = np.nan
        return replace(rows, landmarks=landmarks, detected=rows.detected & ~missed)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(small_dataset, "unit_rows", shifted)
        hidden = replace(HEADS[1], redistributable=False, license="</script><b>FaceScape & co")
        build(root, heads=(HEADS[0], hidden), plan=PLAN)
    return root


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
    assert page_text(data_of(known)) == text  # the same dataset, the same bytes


def test_many_heads_keep_the_page_small(known):
    from generator.dataset.show.report.atlas import NUMBERS, Atlas
    from generator.dataset.show.report.cells import PoseCells

    heads = [replace(HEADS[0], subject=f"p{k}") for k in range(2000)]
    atlas = Atlas(heads, PoseCells.of(grid_plan((-50, 50, 10), (-40, 40, 10), (-30, 30, 10))))
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


# ---- in a browser ------------------------------------------------------------------------------

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--hide-scrollbars",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
    "--enable-logging=stderr", "--virtual-time-budget=5000",
)  # fmt: skip

# Moves the controls as a person would and leaves what is then on the page in its title.
PROBE = """<script>
addEventListener("load", () => {
  const $ = (id) => document.getElementById(id);
  const set = (id, value, event) => { $(id).value = value; $(id).dispatchEvent(new Event(event)); };
  const cells = (id) => Object.fromEntries([...$(id).querySelectorAll("td")].map((td) =>
    [td.dataset.at, td.dataset.value === undefined ? null : Number(td.dataset.value)]));
  const seen = { ready: document.documentElement.dataset.ready };
  seen.all = cells("detection"); seen.distance = cells("atlas");
  set("roll", 2, "input"); seen.detection_roll = cells("detection"); seen.roll = $("roll-value").textContent;
  set("pick", 1, "change"); set("region", 1, "change"); set("measure", "dx", "change");
  seen.eyes_dx = cells("atlas");
  set("measure", "spread", "change"); set("roll", 0, "input"); set("pick", 0, "change");
  seen.eyes_spread = cells("atlas");
  seen.regions = [...$("regions").querySelectorAll("td[data-value]")].map((td) => td.dataset.value);
  const td = $("detection").querySelector('[data-at="4,2"]');
  td.dispatchEvent(new Event("mouseenter")); seen.hover = $("detection-readout").textContent;
  td.focus();
  td.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft", bubbles: true }));
  seen.focus = document.activeElement.dataset.at;
  seen.badges = [...document.querySelectorAll(".badge")].map((b) => b.textContent);
  seen.tiles = document.querySelectorAll(".tile img").length;
  seen.licence = document.querySelectorAll(".head p")[7].textContent;
  seen.wide = document.documentElement.scrollWidth; seen.window = innerWidth;
  const out = document.createElement("pre"); out.id = "probe";
  out.textContent = btoa(unescape(encodeURIComponent(JSON.stringify(seen)))); document.body.append(out);
});
</script>"""


@pytest.fixture(scope="module")
def chromium() -> str:
    """A browser, if there is one."""
    found = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if found is None:
        pytest.skip("no Chromium on this machine; `sh scripts/test_browser.sh` installs Debian's")
    return found


def browse(chromium: str, page: Path, tmp_path: Path, *options: str) -> subprocess.CompletedProcess[str]:
    """Open a page in a browser that knows nothing; stderr holds its console."""
    command = [chromium, *FLAGS, f"--user-data-dir={tmp_path / 'profile'}", *options, page.as_uri()]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)


# A window cannot be as narrow as a telephone, a frame can.
FRAME = """<!DOCTYPE html>
<iframe id="frame" style="border: 0" width="{width}" height="900" srcdoc="{page}"></iframe>
<pre id="seen"></pre><script>addEventListener("load", () => {{ document.getElementById("seen").textContent =
  document.getElementById("frame").contentDocument.getElementById("probe").textContent; }});</script>"""


@pytest.mark.parametrize("width", [1400, 390])
def test_what_a_browser_shows_is_what_the_table_says(known, chromium, tmp_path, width):
    page = tmp_path / "r.html"
    write_report(known, page)
    text = page.read_text(encoding="utf-8").replace("</body>", PROBE + "</body>")
    page.write_text(FRAME.format(width=width, page=html.escape(text)), encoding="utf-8")
    shown = browse(chromium, page, tmp_path, "--window-size=1500,1000", "--dump-dom")
    assert "CONSOLE" not in shown.stderr, shown.stderr
    probe = re.search(r'<pre id="seen">([^<]+)</pre>', shown.stdout)
    assert probe, shown.stderr
    seen = json.loads(base64.b64decode(probe.group(1)))
    assert seen["ready"] == "yes"
    assert seen["wide"] <= seen["window"] == width  # nothing sticks out

    table = pq.read_table(known / "data").to_pylist()
    yaws, pitches = (-30, -15, 0, 15, 30), (-20, 0, 20)

    def rows(at: str, **wanted) -> list[dict]:
        i, j = map(int, at.split(","))
        place = {"yaw_deg": yaws[i], "pitch_deg": pitches[j], **wanted}
        return [row for row in table if all(row[name] == value for name, value in place.items())]

    def rate(found: list[dict]) -> float:
        return sum(row["detected"] for row in found) / len(found)

    assert len(seen["all"]) == 15
    assert seen["all"] == {at: rate(rows(at)) for at in seen["all"]}
    assert seen["roll"] == "0°"
    assert seen["detection_roll"] == {at: rate(rows(at, roll_deg=0)) for at in seen["all"]}
    for at, value in seen["distance"].items():
        expected = [distance(row) for row in rows(at) if row["detected"]]
        assert value == (pytest.approx(np.mean(expected), abs=2e-3) if expected else None)
    missed = {at for at in seen["all"] if seen["all"][at] == 0}
    assert missed == {"4,2"}
    dx, dy = SHIFT["eyes"]
    for at, value in seen["eyes_dx"].items():
        assert value == (None if at in missed else pytest.approx(dx, abs=1e-3))
    for at, value in seen["eyes_spread"].items():
        assert value == (None if at in missed else pytest.approx(np.hypot(dx, dy) / 2, abs=2e-3))
    whole = [distance(row) for row in table if row["detected"]]
    assert float(seen["regions"][0]) == pytest.approx(np.mean(whole), abs=2e-3)
    assert "0 of 6 faces found" in seen["hover"] and "Yaw +30°, pitch +20°" in seen["hover"]
    assert seen["focus"] == "3,2"
    assert seen["badges"] == ["✓ may be published", "✕ not for publication"]
    assert seen["licence"] == "</script><b>FaceScape & co"
    assert seen["tiles"] == 2 * 9


def distance(row: dict) -> float:
    """Mean distance of the detected landmarks from the exact ones, pixels, from the labels alone."""
    r = Rotation.from_euler("XYZ", [-row["pitch_deg"], row["yaw_deg"], row["roll_deg"]], degrees=True)
    mm = r.apply(face_points()) + row["translation_mm"]
    exact = CAMERA.project(mm)[:-1]  # the last point has no anchor
    found = np.array(row["landmarks"]).reshape(468, 3)[:-1, :2]
    return float(np.linalg.norm(found - exact, axis=1).mean())


@pytest.mark.parametrize("without", ["exact landmarks", "images"])
def test_a_page_with_less_on_it_has_no_errors_either(tmp_path, build, monkeypatch, chromium, without):
    heads = HEADS
    if without == "exact landmarks":
        monkeypatch.setattr(small_dataset, "face_anchors", lambda: np.full((468, 3), np.nan))
        heads = tuple(replace(head, anchor_absent=468) for head in HEADS)
    build(tmp_path / "d", "none" if without == "images" else "files", heads=heads)
    write_report(tmp_path / "d", tmp_path / "r.html")
    shown = browse(chromium, tmp_path / "r.html", tmp_path, "--dump-dom")
    assert "CONSOLE" not in shown.stderr, shown.stderr
    assert 'data-ready="yes"' in shown.stdout
    assert (
        "No head of this dataset has exact landmarks" in re.sub("<script.*</script>", "", shown.stdout)
    ) == (without == "exact landmarks")
