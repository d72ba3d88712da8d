# SPDX-License-Identifier: GPL-3.0-or-later
"""A user's own things: what their files say, where they are put, and what is said of bad ones."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from generator.errors import UsageError
from generator.heads.mesh import HeadMesh, Material
from generator.picture.settled import check_files, settled
from generator.plan.config import BuildConfig, load_config
from generator.plan.thing import read_attachment
from generator.plan.view_plan import plan_views
from generator.registries import WORN
from generator.worn.fit import CannotWear, Fit
from generator.worn.things import check_things

PLACES = {33: [-45.0, 10, 92], 263: [45.0, 10, 92], 1: [0.0, -28, 130], 152: [0.0, -100, 105]}
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
POINTS = [{"landmark": k, "point": [x / 10, y / 10, z / 10]} for k, (x, y, z) in PLACES.items()]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two things, in cm."""
    for name in ("crown", "visor"):
        (tmp_path / f"{name}.obj").write_text(OBJ)
        said = {"label": "headwear", "units": "cm", "points": POINTS, "gloss": 0.5}
        (tmp_path / f"{name}.json").write_text(json.dumps(said))
    return tmp_path


@pytest.fixture
def fit(folder: Path) -> Fit:
    """A head of which only some landmarks are known, turned and moved."""
    points = np.full((468, 3), np.nan)
    points[[*PLACES]] = np.array([*PLACES.values()]) @ np.array([[0, 1.0, 0], [-1, 0, 0], [0, 0, 1]]).T + 5
    triangle = HeadMesh(np.eye(3), np.array([[0, 1, 2]]), None, None, np.zeros(1, int), (Material("skin"),))
    scratch = folder / "scratch"
    scratch.mkdir()
    return Fit(triangle, points, things=str(folder), scratch=str(scratch))


def config(folder: Path, thing: str = "all") -> BuildConfig:
    return load_config(None, {"render": {"things": str(folder), "thing": thing}})


def change(folder: Path, **changes: Any) -> None:
    """Other values in the file of the crown."""
    path = folder / "crown.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | changes))


def crown(fit: Fit) -> HeadMesh:
    return WORN.get("thing").make(fit, "crown", np.random.default_rng(0))


def test_a_thing_of_known_size_is_where_its_points_are(fit: Fit) -> None:
    made = crown(fit)
    expected = np.array([[0, 0, 0], [10, 0, 0], [0, 10, 0], [0, 0, 10]])
    turned = expected @ np.array([[0, 1.0, 0], [-1, 0, 0], [0, 0, 1]]).T + 5
    assert np.abs(made.vertices - turned).max() < 1e-9
    assert {(m.label, m.gloss, m.opacity) for m in made.materials} == {("headwear", 0.5, 1.0)}


def test_a_thing_of_no_unit_is_scaled_and_one_with_a_unit_is_not(fit: Fit, folder: Path) -> None:
    wide = [{"landmark": k, "point": [3 * x for x in place]} for k, place in PLACES.items()]
    change(folder, points=wide, units="mm")
    assert np.isclose(np.linalg.norm(np.diff(crown(fit).vertices[:2], axis=0)), 1.0)
    change(folder, points=wide, units=None, opacity=0.25)
    assert np.isclose(np.linalg.norm(np.diff(crown(fit).vertices[:2], axis=0)), 1 / 3)
    assert crown(fit).materials[0].opacity == 0.25


def test_what_a_head_lacks_is_said(fit: Fit) -> None:
    points = fit.points.copy()
    points[152] = np.nan
    with pytest.raises(CannotWear, match="landmark 152 has no place"):
        crown(replace(fit, points=points))


def test_all_is_each_by_its_name_and_the_digest_knows_the_bytes(folder: Path) -> None:
    found = settled(config(folder))
    assert found.drawn["render.thing"].texts == ("crown", "visor")
    check_things(found)
    check_files(found)
    views = plan_views(found, "amy/neutral", 120.0, [(float(yaw), 0.0, 0.0) for yaw in range(20)])
    assert {view.look.wears["thing"] for view in views} == {"crown", "visor"}
    one = settled(config(folder, "choice:none,crown"))
    assert one.render.files_sha256 != found.render.files_sha256
    (folder / "crown.mtl").write_text("newmtl gold\n")
    assert settled(config(folder)).render.files_sha256 != found.render.files_sha256
    with pytest.raises(UsageError, match="things are others than then"):
        check_files(found)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"label": "crown"}, "label is 'crown'; expected one of skin"),
        ({"units": "inch"}, "units are 'inch'; expected one of mm"),
        ({"points": POINTS[:2]}, "2 points; expected a list of 3 or more"),
        ({"points": "none"}, "no points; expected a list"),
        (
            {"points": [{"landmark": 468, "point": [0, 0, 0]}, *POINTS]},
            "no landmark '468'; there are 0 to 467",
        ),
        ({"points": [{"landmark": True, "point": [0, 0, 0]}, *POINTS]}, "no landmark 'True'"),
        ({"points": [*POINTS, POINTS[0]]}, "a landmark is named twice"),
        ({"points": [{"landmark": 5, "point": [0, 0]}, *POINTS]}, "point 1: expected three numbers"),
        ({"points": [{"landmark": 5, "point": [0, 0, 1e999]}, *POINTS]}, "point 1: expected three numbers"),
        ({"points": [{"landmark": 5}, *POINTS]}, "point 1: expected {"),
        ({"points": [{"landmark": k, "point": [k, k, 0]} for k in range(4)]}, "lie on one line"),
        ({"points": [{"landmark": k, "point": [1, 1, 1]} for k in range(4)]}, "lie on one line"),
        ({"opacity": 2}, "opacity is '2'; expected a number from 0 to 1"),
        ({"gloss": "high"}, "gloss is 'high'"),
        ({"colour": "red"}, "no 'colour' is known; there are gloss, label"),
    ],
)
def test_a_bad_file_is_named_with_what_is_wrong(folder: Path, changes: dict[str, Any], said: str) -> None:
    change(folder, **changes)
    with pytest.raises(UsageError) as caught:
        settled(config(folder))
    message = str(caught.value)
    assert message.startswith(f"render.things: {folder / 'crown.json'}: ") and said in message
    assert "\n" not in message
    settled(config(folder, "visor"))  # of others nothing is asked


def test_files_that_are_not_there_or_no_json(folder: Path) -> None:
    (folder / "crown.json").write_text("{")
    with pytest.raises(UsageError, match=r"crown\.json: "):
        settled(config(folder, "crown"))
    (folder / "crown.json").write_text("[]")
    with pytest.raises(UsageError, match="expected an object"):
        settled(config(folder, "crown"))
    (folder / "crown.json").unlink()
    with pytest.raises(UsageError, match=r"crown\.obj: crown\.json is missing"):
        settled(config(folder, "crown"))
    with pytest.raises(UsageError, match="no 'hat'; there are crown, visor"):
        settled(config(folder, "hat"))
    with pytest.raises(UsageError, match="no folder of things is given"):
        settled(load_config(None, {"render": {"thing": "crown"}}))
    empty = folder / "scratch"
    empty.mkdir()
    with pytest.raises(UsageError, match=r"no \.obj or \.ply or \.glb is in it"):
        settled(config(empty))
    (folder / "visor.obj").write_text("v 0 0\n")
    with pytest.raises(UsageError, match=r"render\.things: .*visor\.obj"):
        check_things(settled(config(folder, "visor")))


def test_textures_have_the_thing_s_name(folder: Path) -> None:
    from PIL import Image

    Image.new("RGB", (4, 4)).save(folder / "gold.png")
    (folder / "visor.obj").write_text(
        "mtllib visor.mtl\nusemtl g\n" + OBJ.replace("f 1 3 2", "vt 0 0\nf 1/1 3/1 2/1")
    )
    (folder / "visor.mtl").write_text("newmtl g\nmap_Kd gold.png\n")
    with pytest.raises(UsageError, match=r"gold\.png is to have a name that begins with visor"):
        check_things(settled(config(folder, "visor")))


def test_what_is_read_is_what_is_written(folder: Path) -> None:
    found = read_attachment(folder / "crown.obj")
    assert found.label == "headwear" and found.units == "cm" and found.gloss == 0.5 and found.opacity is None
    assert found.points[0] == (33, (-4.5, 1.0, 9.2))
