# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact truth of whole builds: anchors, passes, pose zero, projections, replay."""

from __future__ import annotations

import hashlib
import json
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
import trimesh
from typer.testing import CliRunner

from generator.cli.app import app
from generator.dataset.format.anchors_table import read_anchors
from generator.dataset.format.heads_table import read_heads
from generator.dataset.format.manifest import read_manifest, write_manifest
from generator.dataset.format.open import as_array
from generator.dataset.format.part import check_part, read_part
from generator.dataset.format.passes import read_channels, write_passes
from generator.dataset.proof.verify import verify_dataset
from generator.errors import HeadError, UsageError
from generator.execution.build.run import build
from generator.execution.deep import look_deep
from generator.execution.executors.open import open_executor
from generator.execution.replay import replay_sample, replay_samples
from generator.geometry.rigid import fit_rotations
from generator.geometry.rotation import (
    angles_from_rotation,
    geodesic_deg,
    graphics_rotation,
    rotation_from_angles,
)
from generator.heads.placement import Placement
from generator.heads.read import read_mesh
from generator.heads.source import find_heads
from generator.landmarks.anchors import no_anchors
from generator.landmarks.topology import FACE_MESH
from generator.placing.anchoring import level_head
from generator.plan.config import load_config

POSES = {"yaw": [-40, 40, 40], "pitch": [-20, 20, 40], "roll": [0, 20, 20]}
PASSES = ["depth", "normal", "position", "uv", "object_index"]


class Quiet:
    """Says nothing."""

    def stage(self, name: str, total: int) -> None: ...
    def advance(self, steps: int = 1) -> None: ...
    def note(self, text: str) -> None: ...
    def event(self, name: str, facts: dict) -> None: ...


def run(root: Path, source: Path, **sections: dict) -> Path:
    values = {"poses": POSES, "render": {"resolution": 96}, **sections}
    values["heads"] = {"source": str(source), **sections.get("heads", {})}
    with open_executor("local") as lanes:
        build(load_config(None, values), root, lanes, Quiet())
    return root


def rows_of(root: Path) -> dict[str, np.ndarray]:
    table = pq.read_table(root / "data").sort_by("sample_id")
    names = ("rotation", "landmarks_exact", "landmarks_visible", "translation_mm", "camera")
    return {"sample_id": np.array(table["sample_id"].to_pylist()), **{n: as_array(table, n) for n in names}}


@pytest.fixture(scope="module")
def one_head(parametric_heads: Path) -> Path:
    """The folder of one parametric subject."""
    return sorted(p for p in parametric_heads.iterdir() if p.is_dir())[0]


@pytest.fixture(scope="module")
def truth(one_head: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One head x 12 poses with every pass."""
    return run(
        tmp_path_factory.mktemp("truth") / "d", one_head, dataset={"passes": PASSES, "images": "embedded"}
    )


def test_the_full_proof(truth: Path) -> None:
    report = verify_dataset(truth)
    assert report.ok, report.text()
    assert 0 < report.closure_deg < 2e-5
    assert {"anchors", "exact landmarks", "passes"} <= {check.name for check in report.checks}
    assert len(list((truth / "exr").rglob("*.exr"))) == 12


def test_anchors_lie_on_the_mesh_and_the_fit_closes(truth: Path, one_head: Path, tmp_path: Path) -> None:
    [head] = read_heads(truth)
    [anchors] = read_anchors(truth).values()
    assert head.anchor_views >= 10
    assert head.anchor_absent == 0
    assert head.anchor_residual_px < 4
    assert head.anchor_residual_mm < 3
    assert head.frame == "source"
    mesh = read_mesh(find_heads(one_head).heads[0], tmp_path)
    corners = mesh.vertices[mesh.triangles[anchors.triangles]]
    in_mesh = (anchors.weights[:, :, None] * corners).sum(1)
    ours = (in_mesh - np.array(head.pivot)) * head.mm_per_unit * [1, -1, -1]  # +Y up, +Z forward: to C
    np.testing.assert_allclose(ours, anchors.points, atol=1e-6)
    # In float64 the fit closes to far below a millionth of a degree.
    rotation = rotation_from_angles(np.random.default_rng(0).uniform(-90, 90, (50, 3)))
    posed = anchors.points @ np.swapaxes(rotation, 1, 2) + [0, 0, head.distance_mm]
    assert geodesic_deg(fit_rotations(anchors.points, posed), rotation).max() < 1e-6
    # PnP sees pixels and K alone.
    camera = head.camera(96)
    for turned, points in zip(rotation[:10], posed, strict=False):
        _, vector, shift = cv2.solvePnP(
            anchors.points, camera.project(points), camera.matrix, None, flags=cv2.SOLVEPNP_SQPNP
        )
        vector, shift = cv2.solvePnPRefineLM(
            anchors.points, camera.project(points), camera.matrix, None, vector, shift
        )
        assert geodesic_deg(cv2.Rodrigues(vector)[0], turned) < 1e-6
        np.testing.assert_allclose(shift[:, 0], camera.translation_mm, atol=1e-5)


@pytest.mark.parametrize("what", ["value", "missing", "no picture", "visible"])
def test_wrong_passes_and_visibility_are_found(truth: Path, tmp_path: Path, what: str) -> None:
    root = Path(shutil.copytree(truth, tmp_path / "d"))
    [first, *_] = sorted((root / "exr").rglob("*.exr"))
    relative = first.relative_to(root).as_posix()
    if what == "missing":
        first.unlink()
        expected = f"{first}: is missing; run `headturn build` again"
    elif what == "no picture":
        first.write_bytes(b"no OpenEXR")
        expected = f"{first}: not a readable OpenEXR; run `headturn build` again"
    elif what == "value":
        shutil.copy(sorted((root / "exr").rglob("*.exr"))[1], first)
        expected = f"{relative}: the passes are not those that were rendered (SHA-256 differs)"
    else:
        manifest = read_manifest(root)
        path = root / manifest.parts[0].path
        table = read_part(path)
        place = table.schema.get_field_index("landmarks_visible")
        flipped = ~as_array(table, "landmarks_visible").astype(bool)
        column = pa.array(flipped.tolist(), type=table.schema.field(place).type)
        pq.write_table(table.set_column(place, table.schema.field(place), column), path)
        part = check_part(path)
        write_manifest(replace(manifest, parts=(part, *manifest.parts[1:])), root)
        expected = "landmarks_visible and depth disagree on"
    [problem] = [check for check in verify_dataset(root).checks if check.name == "passes"]
    assert not problem.ok
    assert expected in problem.detail


def test_each_frame_is_derived_from_the_other(truth: Path, one_head: Path, tmp_path: Path) -> None:
    """R_source = R_level · D C D, C being the column `correction`; pictures prove it."""
    canonical = run(tmp_path / "level", one_head, poses={**POSES, "frame": "level"})
    assert verify_dataset(canonical).ok
    [head] = read_heads(canonical)
    [in_source] = read_heads(truth)
    assert head.frame == "level"
    assert head.correction == in_source.correction, "estimated and recorded in either frame"
    assert all(0 < sd < 6 for sd in head.correction_sd_deg)
    correction = graphics_rotation(np.array(head.correction).reshape(3, 3))
    tilt = float(geodesic_deg(correction, np.eye(3)))
    assert 0.2 < tilt < 20
    levelled, plain = rows_of(canonical), read_anchors(truth)[head.subject, head.expression].points
    rotation = levelled["rotation"].reshape(-1, 3, 3)
    derived = rotation @ correction
    again = plain @ np.swapaxes(derived, 1, 2) + levelled["translation_mm"][:, None]
    np.testing.assert_allclose(levelled["landmarks_exact"], again, atol=1e-3)

    # The source frame at the derived angles shows the very same picture.
    angles = angles_from_rotation(derived[:2])
    poses = tmp_path / "poses.csv"
    lines = ["yaw_deg,pitch_deg,roll_deg", *(",".join(f"{a:.12f}" for a in row) for row in angles)]
    poses.write_text("\n".join(lines) + "\n")
    source = run(tmp_path / "source", one_head, poses={"kind": "csv", "path": str(poses)})
    ours = pq.read_table(source / "data").to_pylist()
    theirs = pq.read_table(canonical / "data").sort_by("sample_id").to_pylist()[:2]
    for turn, other in zip(derived[:2], theirs, strict=True):
        [row] = [r for r in ours if geodesic_deg(np.reshape(r["rotation"], (3, 3)), turn) < 1e-6]
        a, b = (cv2.imread(str(f / r["image_path"])) for f, r in ((source, row), (canonical, other)))
        assert np.abs(a.astype(int) - b.astype(int)).mean() < 0.05


@pytest.mark.parametrize("frame", ["level", "canonical"])
def test_a_head_that_cannot_be_levelled_is_refused_in_one_line(one_head: Path, frame: str) -> None:
    head = find_heads(one_head).heads[0]
    nothing = no_anchors(FACE_MESH)
    placement = Placement("mm", 1.0, "+Y", "+Z", (0.0, 0.0, 0.0), 150.0, 90.0)
    assert level_head(head, placement, nothing, None, FACE_MESH) == placement
    with pytest.raises(HeadError, match=r"neutral\.obj: cannot be levelled: too few landmarks") as error:
        level_head(head, replace(placement, frame=frame), nothing, None, FACE_MESH)
    assert "\n" not in str(error.value)


def test_an_expression_without_a_face_is_built_and_says_so(one_head: Path, tmp_path: Path) -> None:
    """The centre comes from the neutral head; the ball beside it has no place for a landmark."""
    heads = Path(shutil.copytree(one_head, tmp_path / "all" / "amy"))
    (heads / "head.json").unlink()
    ball = trimesh.creation.icosphere(subdivisions=2, radius=90)
    ball.apply_translation([0, 1500, 0])
    ball.export(heads / "ball.obj")
    one = {"yaw": [0, 0, 10], "pitch": [0, 0, 10], "roll": [0, 20, 20]}
    mm = {"units": "mm", "up": "+Y", "forward": "+Z"}
    root = run(tmp_path / "d", heads.parent, poses=one, heads=mm)
    rows = {head.expression: head for head in read_heads(root)}
    assert (rows["ball"].anchor_views, rows["ball"].anchor_absent) == (0, 468)
    assert "no face was found near the front: landmarks_exact is NaN" in rows["ball"].problems
    assert rows["neutral"].anchor_absent == 0
    table = pq.read_table(root / "data").filter(pc.field("expression") == "ball")
    assert len(table) == 2
    assert np.isnan(as_array(table, "landmarks_exact")).all()
    assert not as_array(table, "landmarks_visible").any()
    assert verify_dataset(root).ok


@pytest.mark.parametrize(
    ("lens", "projection"), [(20, "perspective"), (135, "perspective"), (85, "orthographic")]
)
def test_lenses_and_projections_verify(lens: float, projection: str, one_head: Path, tmp_path: Path) -> None:
    render = {"resolution": 96, "lens_mm": lens, "projection": projection}
    root = run(tmp_path / "d", one_head, render=render, dataset={"passes": ["depth", "position"]})
    report = verify_dataset(root)
    assert report.ok, report.text()
    assert set(pq.read_table(root / "data")["projection"].to_pylist()) == {projection}
    [head] = read_heads(root)
    assert (head.lens_mm, head.projection) == (lens, projection)


def test_replay_gives_the_same_bytes(truth: Path, tmp_path: Path) -> None:
    name = str(rows_of(truth)["sample_id"][3])
    found = replay_sample(truth, name, picture=tmp_path / "again.png")
    assert found.same, found.text()
    assert found.versions == ()
    assert (tmp_path / "again.png").stat().st_size > 1000
    answer = CliRunner().invoke(app, ["replay", str(truth), name, "--json"])
    assert answer.exit_code == 0
    assert json.loads(answer.stdout)["same"]


def test_replay_says_what_differs(truth: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(truth, tmp_path / "d"))
    manifest = read_manifest(root)
    path = root / manifest.parts[0].path
    table = read_part(path)
    name = table["sample_id"][0].as_py()
    place = table.schema.get_field_index("image_sha256")
    changed = pa.array(["0" * 64, *table["image_sha256"].to_pylist()[1:]])
    pq.write_table(table.set_column(place, table.schema.field(place), changed), path)
    write_manifest(replace(manifest, parts=(check_part(path), *manifest.parts[1:])), root)
    found = replay_sample(root, name)
    assert not found.same
    assert found.differences == (
        f"the embedded image of {name} is what is rendered now; the hash in its row is not its own and "
        "was changed",
    )


def test_replay_compares_the_passes_and_not_only_their_hash(truth: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(truth, tmp_path / "d"))
    first, second = (str(rows_of(root)["sample_id"][row]) for row in (0, 1))
    file = root / "exr" / f"{first}.exr"
    write_passes({name: values + 1 for name, values in read_channels(file).items()}, file)
    changed, same = replay_samples(root, [first, second])
    says = "was changed after the build; what is rendered now has the recorded hash"
    assert changed.differences == (f"exr/{first}.exr {says}",)
    assert same.same and f"exr/{second}.exr, its recorded hash and the new passes" in same.text()


def test_a_grey_picture_with_its_hash_fixed_everywhere(truth: Path, tmp_path: Path) -> None:
    root = Path(shutil.copytree(truth, tmp_path / "d"))
    manifest = read_manifest(root)
    path = root / manifest.parts[0].path
    table = read_part(path)
    images, hashes = (table[column].to_pylist() for column in ("image", "image_sha256"))
    grey = cv2.imencode(".png", np.full((96, 96, 3), 128, np.uint8))[1].tobytes()
    images[0]["bytes"], hashes[0] = grey, hashlib.sha256(grey).hexdigest()
    for column, values in (("image", images), ("image_sha256", hashes)):
        place = table.schema.get_field_index(column)
        field = table.schema.field(place)
        table = table.set_column(place, field, pa.array(values, field.type))
    pq.write_table(table, path)
    write_manifest(replace(manifest, parts=(check_part(path), *manifest.parts[1:])), root)
    report = verify_dataset(root)
    assert report.ok, report.text()
    deep = look_deep(report, root, None)
    [wrong] = [check for check in deep.checks if not check.ok]
    assert deep.deep is not None and deep.deep.complete and deep.deep.decoded == 12
    assert wrong.count == 1, wrong.detail
    assert f"{table['sample_id'][0]}: the image differs: up to " in wrong.detail


def test_replay_refuses_other_heads_in_one_line(one_head: Path, tmp_path: Path) -> None:
    heads = Path(shutil.copytree(one_head, tmp_path / one_head.name))
    one = {"yaw": [0, 0, 10], "pitch": [0, 0, 10], "roll": [0, 0, 10]}
    root = run(tmp_path / "d", heads, poses=one, dataset={"images": "none"})
    name = str(rows_of(root)["sample_id"][0])
    with pytest.raises(UsageError, match=r"no sample 'x/y/z'; names are like"):
        replay_sample(root, "x/y/z")
    mesh = heads / "neutral.obj"
    mesh.write_text(mesh.read_text() + "# touched\n")
    with pytest.raises(HeadError, match=r"neutral\.obj: was changed after the build \(SHA-256 differs\)"):
        replay_sample(root, name)
    mesh.unlink()
    with pytest.raises(HeadError, match=r"neutral\.obj: a file of .* is gone; give the place"):
        replay_sample(root, name)
    shutil.rmtree(heads)
    with pytest.raises(HeadError, match="are not there any more; give the place it was moved to"):
        replay_sample(root, name)
    assert replay_sample(root, name, heads=one_head).same, "or from where it was moved to"
