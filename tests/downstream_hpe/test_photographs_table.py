# SPDX-License-Identifier: MIT
"""scripts/photographs.py: on faces made up here, and on real ones where they lie."""

from __future__ import annotations

import sys
from pathlib import Path

import ideal
import numpy as np
import pytest

from downstream_hpe.geometry.rotation import angles_from_rotation, rotation_from_angles
from scripts import photographs

pytest.importorskip("onnxruntime")

REAL = Path(__file__).resolve().parents[3] / "shared" / "real_faces"
FIGURES = "2.74 | 2.86 / 3.72 / 1.65 | 5.47 | -0.1 / -0.6 / +0.2 |"
"""Of the rigid fit, in the README beside the file."""


def run(*arguments, monkeypatch):
    """Exit code of the script."""
    monkeypatch.setattr(sys, "argv", ["photographs.py", *map(str, arguments)])
    try:
        photographs.main()
    except SystemExit as stopped:
        return stopped.code
    return 0


@pytest.fixture
def file(tmp_path):
    """Sixty turned faces whose zero is 4 degrees of pitch from the labels', three of them missed."""
    rng = np.random.default_rng(4)
    face = ideal.Faces().draw(1, rng)
    face[0, 10, 1], face[0, 152, 1], face[0, 1, 2] = -6, 6, -6
    ypr = rng.uniform(-1, 1, size=(60, 3)) * [60, 35, 25]
    ypr[:3], ypr[3] = [10, 20, -5], [70, 0, 0]
    truth = rotation_from_angles(ypr) @ rotation_from_angles([0, 4, 0]).T
    landmarks = ideal.turned(face, angles_from_rotation(truth)).astype(np.float32)
    landmarks[:3] = np.nan
    names = np.array([f"p{n}" for n in range(60)])
    arrays = {"landmarks": landmarks, "detected": np.arange(60) > 2, "ypr_deg": ypr, "image": names}
    np.savez(tmp_path / "f.npz", **arrays)
    np.savetxt(tmp_path / "canonical_face.csv", face[0], delimiter=",")
    return tmp_path / "f.npz", arrays


def test_the_table_has_raw_constant_and_what_is_left(file, monkeypatch, capsys):
    path, arrays = file
    inside = (np.abs(arrays["ypr_deg"]) <= [50, 40, 30]).all(axis=1)
    assert run(path, monkeypatch=monkeypatch) == 0
    first, second = capsys.readouterr().out.split("Labels up to 99 degrees")
    assert first.startswith("Labels within 50, 40, 30 degrees")
    for text, count in ((first, inside.sum()), (second, 60)):
        (line,) = (line for line in text.splitlines() if line.startswith("| rigid fit"))
        cells = [cell.strip() for cell in line.split("|")]
        assert cells[2] == str(count - 3)
        assert cells[5] == "4.00"
        assert float(cells[6].split("/")[1]) == pytest.approx(-4, abs=0.6)
        assert cells[7] == "0.00"
        assert "| model headturn | " in text
        assert "| confidence | rows | mean confidence | share below 5°" in text
        assert f"no face found in 3 of {count} " in text
        assert "  p0: 10 / 20 / -5\n  p1: 10 / 20 / -5\n  p2: 10 / 20 / -5\n" in text


def test_bad_input_is_one_line(file, monkeypatch, capsys):
    path, arrays = file
    folder = path.parent
    spoilt = {
        "a": {"image": arrays["image"][:5]},
        "b": {"ypr_deg": np.full((60, 3), np.nan)},
        "c": {"detected": np.ones(60, bool)},
        "d": {"landmarks": np.zeros((60, 468, 3), int)},
        "e": {"detected": np.zeros(60, bool)},
    }
    for name, change in spoilt.items():
        np.savez(folder / f"{name}.npz", **arrays | change)
    np.savez(folder / "g.npz", landmarks=arrays["landmarks"])
    (folder / "h.npz").write_bytes(b"no")
    says = {
        "a": "its arrays have the shapes",
        "b": "is not finite",
        "c": "is not finite",
        "d": "landmarks of another type",
        "e": "fewer than two faces found",
        **dict.fromkeys(("g", "h", "nowhere"), "expected an .npz with the arrays"),
    }
    for name, expected in says.items():
        assert run(folder / f"{name}.npz", monkeypatch=monkeypatch) == 1
        error = capsys.readouterr().err
        assert expected in error
        assert error.count("\n") == 1
    for more, expected in (("--model", "no such model"), ("--canonical", "not readable as a reference face")):
        assert run(path, more, folder / "none.csv", monkeypatch=monkeypatch) == 1
        error = capsys.readouterr().err
        assert expected in error
        assert error.count("\n") == 1


@pytest.mark.skipif(not REAL.is_dir(), reason="needs the landmarks of real faces, which are not published")
def test_the_known_figures_of_the_rigid_fit(monkeypatch, capsys):
    assert run(REAL / "aflw2000_even.npz", monkeypatch=monkeypatch) == 0
    text = capsys.readouterr().out
    assert f"| rigid fit to the canonical face | 719 | {FIGURES}" in text
    assert "no face found in 2 of 721" in text
