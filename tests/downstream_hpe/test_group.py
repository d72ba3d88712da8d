# SPDX-License-Identifier: MIT
"""Group photographs and boxes with the real detector, several processes, and the inputs in shared/."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from downstream_hpe import cli

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
CASES = ROOT.parent / "shared" / "cases" / "predict"
sys.path.append(str(ROOT / "benchmarks"))


def run(*arguments, monkeypatch, capfd):
    """Exit code, rows and what is noted of predict."""
    monkeypatch.setattr(sys, "argv", ["downstream-hpe", "predict", *map(str, arguments), "--json"])
    with pytest.raises(SystemExit) as stopped:
        cli.main()
    output, errors = capfd.readouterr()
    return stopped.value.code or 0, [json.loads(line) for line in output.splitlines()], errors


@pytest.fixture(scope="module")
def portraits():
    """Two of packages that are installed, cut to the head."""
    pytest.importorskip("mediapipe")
    pytest.importorskip("skimage")
    import groups

    return groups.portraits()


def group(portraits, count: int, width: int) -> tuple[Image.Image, np.ndarray]:
    """So many heads, their pictures so wide, in one of 1600 x 1067, and their middles, [count, 2]."""
    import groups

    bgr, middles = groups.group(portraits, count, width)
    return Image.fromarray(bgr[..., ::-1]), middles


@pytest.mark.parametrize(("count", "width"), [(5, 160), (15, 128), (29, 64)])
def test_all_of_a_group_are_found(count, width, portraits, tmp_path, monkeypatch, capfd):
    whole, middles = group(portraits, count, width)
    whole.save(tmp_path / "group.png")
    code, rows, errors = run(tmp_path / "group.png", "--faces", 40, monkeypatch=monkeypatch, capfd=capfd)
    assert code == 0 and len(errors.splitlines()) == 2
    found = np.array([[r["box_x"] + r["box_width"] / 2, r["box_y"] + r["box_height"] / 2] for r in rows])
    nearest = np.linalg.norm(found[:, None] - middles, axis=-1)
    assert sorted(nearest.argmin(axis=1).tolist()) == list(range(count))  # each once, and nobody else
    assert nearest.min(axis=1).max() < 0.4 * width


def test_the_small_faces_of_a_video_are_found_and_followed(portraits):
    """A camera that pans over 15 heads; of those in sight, a frame alone shows few."""
    import groups

    from downstream_hpe.prediction.predictor import Predictor
    from downstream_hpe.prediction.way_up import WayUp

    bgr, middles = groups.group(portraits, 15, 128)
    way_up, alone, every, seen, there = WayUp(), 0, 0, 0, 0
    with Predictor() as predictor:
        for n in range(3):
            frame = np.ascontiguousarray(bgr[:800, 20 * n : 20 * n + 1280])
            found = way_up.faces(predictor, frame, 40, n / 10)[..., :2].mean(axis=1)
            heads = middles - [20 * n, 0]
            near = np.linalg.norm(found[:, None] - heads, axis=-1)
            assert (near.min(axis=1) < 50).all() and len(set(near.argmin(axis=1).tolist())) == len(found)
            in_sight = np.flatnonzero(((heads > 70) & (heads < [1210, 730])).all(axis=1))
            seen += len(set(in_sight.tolist()) & set(near.argmin(axis=1).tolist()))
            every += len(found)
            alone += len(predictor.faces(frame, 40, False))
            there += len(in_sight)
    assert seen >= 0.95 * there > 10 and alone < 0.8 * every


def test_boxes_of_others_are_looked_into(portraits, tmp_path, monkeypatch, capfd):
    whole, middles = group(portraits, 5, 100)
    whole.save(tmp_path / "group.png")
    lines = [f"group.png,{x - 40},{y - 45},80,100" for x, y in middles] + ["group.png,10,10,40,40"]
    (tmp_path / "boxes.csv").write_text("picture,x,y,w,h\n" + "\n".join(lines))
    options = ("--boxes", tmp_path / "boxes.csv", "--draw", tmp_path / "drawn.png")
    code, rows, _ = run(tmp_path / "group.png", *options, monkeypatch=monkeypatch, capfd=capfd)
    assert code == 0 and [(row["face"], row["found"]) for row in rows] == [
        *((n, True) for n in range(5)),
        (5, False),
    ]
    assert (tmp_path / "drawn.png").is_file()


def test_several_processes_say_what_one_says(portraits, tmp_path, monkeypatch, capfd):
    for n in range(20):
        portraits[n % 2].rotate(n).save(tmp_path / f"{n:02}.png")
    (tmp_path / "07.png").write_text("no picture")
    one = run(tmp_path, monkeypatch=monkeypatch, capfd=capfd)
    two = run(tmp_path, "--workers", 2, monkeypatch=monkeypatch, capfd=capfd)
    assert one[:2] == two[:2] and one[0] == 3 and len(one[1]) == 19
    assert one[2].splitlines()[0] == two[2].splitlines()[0]
    assert "07.png: not a readable picture; it holds text" in one[2]
    code, _, errors = run(tmp_path, "webcam:0", "--workers", 2, monkeypatch=monkeypatch, capfd=capfd)
    assert code == 2 and errors.count("\n") == 1


# ---- the inputs of shared/ ----------------------------------------------


def of_case(name: str) -> Path:
    if not (CASES / name).exists():
        pytest.skip("the inputs in shared/ are not on this machine")
    return CASES / name


ANGLES = ("yaw_deg", "pitch_deg", "roll_deg")


def angles(rows) -> np.ndarray:
    return np.array([[row[name] for name in ANGLES] for row in rows])


def test_a_turned_video_has_the_angles_of_an_upright_one(monkeypatch, capfd):
    rows = [
        run(of_case("video_rotation") / f"{name}.mp4", monkeypatch=monkeypatch, capfd=capfd)[1]
        for name in ("upright", "rotated")
    ]
    assert [len(each) for each in rows] == [20, 20]
    assert np.abs(angles(rows[0]) - angles(rows[1])).max() < 2


@pytest.mark.parametrize("name", ["vfr.mp4", "vfr.mkv"])
def test_a_variable_rate(name, monkeypatch, capfd):
    code, rows, errors = run(of_case("video_variable_rate") / name, monkeypatch=monkeypatch, capfd=capfd)
    assert code == 0 and rows[19]["time_s"] == 5.5 and "ended" not in errors


def test_deep_pictures_have_the_pose_of_flat_ones(monkeypatch, capfd):
    _, rows, _ = run(of_case("grey16"), monkeypatch=monkeypatch, capfd=capfd)
    assert len(rows) == 3 and np.ptp(angles(rows), axis=0).max() < 0.2


def test_formats_of_phones(monkeypatch, capfd):
    pytest.importorskip("pillow_heif")
    _, rows, _ = run(of_case("heic"), monkeypatch=monkeypatch, capfd=capfd)
    assert {Path(row["input"]).suffix for row in rows} == {".heic", ".avif", ".gif", ".ppm"}
    assert all(row["found"] for row in rows) and np.ptp(angles(rows), axis=0).max() < 2
