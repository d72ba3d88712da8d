# SPDX-License-Identifier: GPL-3.0-or-later
"""The report in a browser: what it shows is what the table says."""

from __future__ import annotations

import base64
import html
import json
import re
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
import small_dataset
from known_error import SHIFT
from scipy.spatial.transform import Rotation
from small_dataset import CAMERA, HEADS, face_points

from generator.dataset.ablate.ablation import ablate_dataset
from generator.dataset.show.report.page import write_report

pytestmark = pytest.mark.slow

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
  seen.choices = ["detector", "pick"].filter((id) => $(id).offsetParent);
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
    assert seen["choices"] == ["pick"], "one detector is no choice"

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


DETECTORS_PROBE = """<script>addEventListener("load", () => {
  const $ = (id) => document.getElementById(id);
  const numbers = (id, picked) =>
    [...$(id).querySelectorAll(picked)].map((node) => Number(node.dataset.value));
  const seen = { wide: document.documentElement.scrollWidth, window: innerWidth,
    names: [...$("detector").options].map((one) => one.text), hidden: $("detector-label").hidden,
    table: numbers("detectors", "td"), first: numbers("detection", "td") };
  $("detector").value = 1; $("detector").dispatchEvent(new Event("change"));
  Object.assign(seen, { other: numbers("detection", "td"), distance: numbers("atlas", "td"),
    dots: new Set(numbers("facemap", "circle")).size,
    circles: $("facemap").querySelectorAll("circle").length });
  const out = document.createElement("pre"); out.id = "probe";
  out.textContent = btoa(unescape(encodeURIComponent(JSON.stringify(seen)))); document.body.append(out);
});</script>"""


@pytest.mark.parametrize("width", [1400, 390])
def test_detectors_are_beside_each_other_and_the_maps_are_of_the_chosen_one(chromium, tmp_path, width):
    page = tmp_path / "r.html"
    small_dataset.build_dataset(tmp_path / "d", "none", also={"fdlite": (3.0, -4.0)})
    write_report(tmp_path / "d", page)
    text = page.read_text(encoding="utf-8").replace("</body>", DETECTORS_PROBE + "</body>")
    page.write_text(FRAME.format(width=width, page=html.escape(text)), encoding="utf-8")
    shown = browse(chromium, page, tmp_path, "--window-size=1500,1000", "--dump-dom")
    assert "CONSOLE" not in shown.stderr, shown.stderr
    probe = re.search(r'<pre id="seen">([^<]+)</pre>', shown.stdout)
    assert probe, shown.stderr
    seen = json.loads(base64.b64decode(probe.group(1)))
    assert seen["wide"] <= seen["window"] == width
    assert seen["names"] == ["mediapipe", "fdlite"] and not seen["hidden"]
    mediapipe, fdlite = seen["table"][:4], seen["table"][4:]
    assert mediapipe[0] < fdlite[0] == 100
    assert mediapipe[1] == pytest.approx(0, abs=1e-3) and fdlite[1] == pytest.approx(5, abs=1e-3)
    assert min(seen["first"]) == 0 and {*seen["other"]} == {1}
    assert seen["distance"] == pytest.approx([5.0] * len(seen["distance"]), abs=1e-3)
    assert seen["dots"] == 1 and seen["circles"] == 467


VARIETY_PROBE = """<script>addEventListener("load", () => {
  const seen = { wide: document.documentElement.scrollWidth, window: innerWidth, factors: {}, tiles: 0 };
  for (const card of document.querySelectorAll(".factor")) {
    const numbers = (picked) => [...card.querySelectorAll(picked)].map((node) => node.dataset);
    seen.factors[card.dataset.factor] = { bars: numbers(".bars i").map((d) => Number(d.rows)),
      parts: Object.fromEntries(numbers(".rate").map((d) => [d.part, [Number(d.rows), d.value]])),
      missed: card.querySelectorAll(".missed").length };
  }
  const out = document.createElement("pre"); out.id = "probe";
  out.textContent = btoa(unescape(encodeURIComponent(JSON.stringify(seen)))); document.body.append(out);
});</script>"""


@pytest.mark.parametrize("width", [1400, 390])
def test_what_varies_is_shown_with_its_share_of_faces_found(varied, chromium, tmp_path, width):
    page = tmp_path / "r.html"
    write_report(varied, page)
    text = page.read_text(encoding="utf-8").replace("</body>", VARIETY_PROBE + "</body>")
    page.write_text(FRAME.format(width=width, page=html.escape(text)), encoding="utf-8")
    shown = browse(chromium, page, tmp_path, "--window-size=1500,1000", "--dump-dom")
    assert "CONSOLE" not in shown.stderr, shown.stderr
    probe = re.search(r'<pre id="seen">([^<]+)</pre>', shown.stdout)
    assert probe, shown.stderr
    seen = json.loads(base64.b64decode(probe.group(1)))
    assert seen["wide"] <= seen["window"] == width
    table = pq.read_table(varied / "data").to_pylist()
    plain = [row["detected"] for row in table if row["look_backdrop"] == "plain"]
    backdrop = seen["factors"]["backdrop"]
    rows, share = backdrop["parts"]["plain"]
    assert rows == len(plain) and float(share) == pytest.approx(sum(plain) / len(plain))
    assert backdrop["bars"] == [rows, len(table) - rows] and backdrop["missed"] > 0
    assert "ambient" in seen["factors"] and len(seen["factors"]) == 6


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


EFFECTS = """<script>addEventListener("load", () => {
  const changes = (card) => Object.fromEntries([...card.querySelectorAll("tr[data-change]")].map((row) =>
    [row.dataset.measure, Number(row.dataset.change)]));
  const seen = [...document.querySelectorAll(".effect")].map((card) =>
    [card.dataset.effect, card.querySelectorAll("img").length, changes(card)]);
  document.title = JSON.stringify([seen, document.documentElement.scrollWidth <= innerWidth]);
});</script>"""


def test_effects_of_twins_are_those_of_ablate(chromium: str, tmp_path: Path) -> None:
    root, page = tmp_path / "dataset", tmp_path / "r.html"
    small_dataset.build_dataset(root, twins=("jpeg", "noise"))
    write_report(root, page)
    page.write_text(
        page.read_text(encoding="utf-8").replace("</body>", EFFECTS + "</body>"), encoding="utf-8"
    )
    shown = browse(chromium, page, tmp_path, "--window-size=600,900", "--dump-dom")
    assert "CONSOLE" not in shown.stderr, shown.stderr
    cards, fits = json.loads(html.unescape(re.search(r"<title>(.*?)</title>", shown.stdout).group(1)))
    assert fits
    expected = {one.factor: one.judged[0] for one in ablate_dataset(root).factors}
    assert [name for name, _, _ in cards] == list(expected) == ["jpeg", "noise"]
    for name, pictures, changes in cards:
        assert pictures == 2 * 2 and len(changes) == 6
        for measure, change in changes.items():
            assert change == pytest.approx(expected[name].of(measure).change)
