# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors that all meshes of a topology share: what they are averaged to, and where they lie."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import Delaunay

from generator.errors import HeadError
from generator.geometry.rigid import fit_similarity
from generator.geometry.rotation import (
    CAMERA_FROM_GRAPHICS,
    angles_from_rotation,
    geodesic_deg,
    graphics_rotation,
    rotation_from_angles,
)
from generator.heads.head import Head
from generator.heads.mesh import HeadMesh, Material
from generator.landmarks.facing import detected_facing
from generator.landmarks.shared import (
    SharedAnchors,
    mesh_key,
    of_subject,
    packaged,
    parse_shared,
    shared_levelling_problem,
    write_shared,
)
from generator.landmarks.surface import Surface
from generator.landmarks.topology import FACE_MESH
from generator.placing.anchors import anchors_at
from generator.placing.known import anchors_on, find_known, stand_known
from generator.placing.sharing import OwnAnchors, same_topology, share

CANONICAL_FACE = Path(__file__).resolve().parents[3] / "shared" / "real_faces" / "canonical_face.csv"
HEAD = Head("amy", "neutral", "mesh", Path("amy.obj"), (Path("amy.obj"),))
RNG = np.random.default_rng(3)


def face_mesh(stretch: float = 1.0) -> HeadMesh:
    """A mesh whose vertices are the mean face's points, and triangles between them; frame U, mm."""
    vertices = FACE_MESH.surface_face() * [1.0, stretch, 1.0]
    flat = FACE_MESH.surface_face()[:, :2]
    triangles = _delaunay(flat)
    index = np.zeros(len(triangles), np.int32)
    return HeadMesh(vertices, triangles, None, None, index, (Material("skin"),))


def _delaunay(points: np.ndarray) -> np.ndarray:
    triangles = Delaunay(points).simplices.astype(np.int32)
    a, b, c = points[triangles].transpose(1, 0, 2)
    clockwise = np.cross(b - a, c - a) < 0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return triangles


def found_on(mesh: HeadMesh, noise_mm: float) -> OwnAnchors:
    """What a detector that is off by some millimetres says of it."""
    points = mesh.vertices @ CAMERA_FROM_GRAPHICS + RNG.normal(0, noise_mm, mesh.vertices.shape)
    anchors = replace(anchors_at(Surface(mesh), points, FACE_MESH), views=14, residual_px=2.0)
    up = rotation_from_angles(np.array([0.0, RNG.normal(4.0, 3.0), 0.0]))
    return OwnAnchors(mesh, anchors, graphics_rotation(up))


@pytest.fixture(scope="module")
def shared() -> SharedAnchors:
    heads = [found_on(face_mesh(1 + 0.02 * k), 2.0) for k in range(-6, 7)]
    return share(heads, FACE_MESH, count=len(heads[0].mesh.triangles), way="source")


def test_two_heads_have_their_points_at_the_same_place(shared: SharedAnchors) -> None:
    """To half a millimetre of each other, where a single head's scatter by more."""
    one, other = face_mesh(0.94), face_mesh(1.06)
    alone = [found_on(mesh, 2.0) for mesh in (one, other)]
    back = np.array([1, 1 / 1.06 * 0.94, 1])

    def apart(a: np.ndarray, b: np.ndarray) -> float:
        return float(np.nanmedian(np.linalg.norm(a - b * back, axis=1)))

    scattered = apart(*(head.anchors.points for head in alone))
    together = apart(*(shared.points(mesh.vertices, mesh.triangles) for mesh in (one, other)))
    assert scattered > 1.0
    assert together < 1e-9, "they are the same triangles and weights"
    off = np.linalg.norm(shared.points(one.vertices, one.triangles) - one.vertices, axis=1)
    alone_off = np.linalg.norm(alone[0].anchors.points @ CAMERA_FROM_GRAPHICS - one.vertices, axis=1)
    assert np.nanmedian(off) < 1.0 < np.nanmedian(alone_off), "the errors of detections average out"


def test_they_are_symmetric_and_level_on_average(shared: SharedAnchors) -> None:
    pairs = FACE_MESH.mirror_pairs()
    mirrored = shared.anchors.points[pairs] * [-1, 1, 1]
    assert fit_similarity(mirrored, shared.anchors.points).rms < 1.0
    level = angles_from_rotation(graphics_rotation(np.reshape(shared.correction, (3, 3))))
    assert abs(level[1] - 4.0) < 3 * 3.0 / np.sqrt(13), "the mean of 13 heads' own"
    assert 0.2 < shared.correction_sd_deg[1] < 2.0
    assert (shared.heads, shared.anchors.views, shared.anchors.way) == (13, 13 * 14, "source")


def test_heads_of_another_topology_share_nothing() -> None:
    mesh = face_mesh()
    turned = replace(mesh, triangles=np.ascontiguousarray(mesh.triangles[::-1]))
    count = len(mesh.triangles)
    with pytest.raises(HeadError, match="other triangles"):
        share([found_on(mesh, 1.0), found_on(turned, 1.0)], FACE_MESH, count=count, way="source")
    with pytest.raises(HeadError, match="1 heads: anchors are shared by 2 or more"):
        share([found_on(mesh, 1.0)], FACE_MESH, count=count, way="source")


def test_topologies_are_told_apart_by_their_triangles_and_hair_behind_them_is_none() -> None:
    bald = face_mesh().triangles
    long_hair = np.concatenate([bald, bald[:50] + 1])
    other = bald[::-1]
    mostly_hair = np.concatenate([bald, bald + 1, bald + 2])
    found = same_topology([long_hair, other, bald, long_hair, mostly_hair])
    assert found == [(len(bald), [1]), (len(bald), [0, 2, 3]), (len(mostly_hair), [4])]


def test_a_mesh_is_known_by_its_triangles_and_by_its_face(shared: SharedAnchors) -> None:
    mesh = face_mesh(1.03)
    assert find_known(mesh, [shared], FACE_MESH) is shared
    more = replace(
        mesh,
        triangles=np.concatenate([mesh.triangles, mesh.triangles[:5]]),
        material_index=np.zeros(len(mesh.triangles) + 5, np.int32),
    )
    assert find_known(more, [shared], FACE_MESH) is shared, "with long hair behind them"
    fewer = replace(mesh, triangles=mesh.triangles[5:], material_index=mesh.material_index[5:])
    assert find_known(fewer, [shared], FACE_MESH) is None
    crumpled = replace(mesh, vertices=mesh.vertices[RNG.permutation(len(mesh.vertices))])
    assert find_known(crumpled, [shared], FACE_MESH) is None, "the same triangles, and no face"


def test_a_known_head_stands_where_its_anchors_say(shared: SharedAnchors) -> None:
    mesh = face_mesh()
    to_z_up = np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]])
    lying = replace(mesh, vertices=mesh.vertices @ to_z_up.T / 10 + [1.0, 2.0, 3.0])
    placement = stand_known(HEAD, lying, shared, FACE_MESH)
    assert (placement.units, placement.up, placement.forward) == ("cm", "+Z", "-Y")
    upright = stand_known(HEAD, mesh, shared, FACE_MESH)
    moved = to_z_up @ upright.pivot / 10 + [1.0, 2.0, 3.0]
    np.testing.assert_allclose(placement.pivot, moved, atol=2e-3)
    assert abs(placement.eye_distance_mm - 90) < 3
    anchors = anchors_on(lying, placement, shared)
    np.testing.assert_allclose(anchors.points, anchors_on(mesh, upright, shared).points, atol=0.03)
    with pytest.raises(HeadError, match=r"^amy\.obj: in m the outer eye corners are"):
        stand_known(replace(HEAD, units="m"), lying, shared, FACE_MESH)


def test_what_is_left_out_of_a_mesh_moves_no_anchor(shared: SharedAnchors) -> None:
    mesh = face_mesh()
    stray_triangle = mesh.vertices.max(axis=0) * 20 + np.array([[0, 0, 0], [5, 0, 0], [0, 5, 0]])
    stray = replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, stray_triangle]),
        triangles=np.concatenate([mesh.triangles, [[468, 469, 470]]]).astype(np.int32),
        material_index=np.zeros(len(mesh.triangles) + 1, np.int32),
    )
    placement = stand_known(HEAD, stray, shared, FACE_MESH)
    assert any("1 of" in note and "left out" in note for note in placement.notes)
    np.testing.assert_array_equal(
        anchors_on(stray, placement, shared).triangles, anchors_on(mesh, placement, shared).triangles
    )


def test_what_is_left_out_before_a_face_moves_its_triangles(shared: SharedAnchors) -> None:
    """Anchors of a mesh as read count a stray triangle that stands first; those of its head do not."""
    mesh = face_mesh()
    stray = mesh.vertices.max(axis=0) * 20 + np.array([[0, 0, 0], [5, 0, 0], [0, 5, 0]])
    triangles = np.concatenate([[[468, 469, 470]], mesh.triangles]).astype(np.int32)
    index = np.zeros(len(triangles), np.int32)
    first = replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, stray]),
        triangles=triangles,
        material_index=index,
    )
    as_read = replace(
        shared,
        mesh=mesh_key(triangles),
        count=len(triangles),
        anchors=replace(shared.anchors, triangles=shared.anchors.triangles + 1),
    )
    placement = stand_known(HEAD, first, as_read, FACE_MESH)
    found = anchors_on(first, placement, as_read)
    np.testing.assert_array_equal(found.triangles, shared.anchors.triangles)
    assert not found.absent


def test_a_head_that_was_not_aligned_with_the_others_is_levelled_by_itself(shared: SharedAnchors) -> None:
    usual = np.reshape(shared.correction, (3, 3))
    points = shared.anchors.points
    np.testing.assert_array_equal(shared.correction_of(points, FACE_MESH), usual)
    aside = rotation_from_angles(np.array([30.0, 5.0, 0.0]))
    correction = shared.correction_of(points @ aside.T, FACE_MESH)
    assert geodesic_deg(correction, usual @ graphics_rotation(aside.T)) < 1e-4


def test_the_table_is_read_as_it_was_written(shared: SharedAnchors, tmp_path: Path) -> None:
    write_shared(shared, tmp_path / "a.csv", "a test")
    again = parse_shared((tmp_path / "a.csv").read_text())
    assert (again.mesh, again.count, again.heads) == (shared.mesh, shared.count, shared.heads)
    assert again.correction == shared.correction and again.correction_sd_deg == shared.correction_sd_deg
    np.testing.assert_array_equal(again.anchors.triangles, shared.anchors.triangles)
    np.testing.assert_allclose(again.anchors.weights, shared.anchors.weights, atol=1e-12)
    np.testing.assert_allclose(again.anchors.points, shared.anchors.points, atol=1e-4)
    assert not again.contradiction(FACE_MESH)
    twisted = replace(again, correction=(1.1, *again.correction[1:]))
    assert twisted.contradiction(FACE_MESH) == "its correction is no rotation"
    beyond = replace(again, count=10)
    assert beyond.contradiction(FACE_MESH) == "an anchor's triangle does not exist"


def test_what_the_package_brings_is_sound() -> None:
    [found] = packaged(FACE_MESH)
    assert not found.contradiction(FACE_MESH)
    assert found.anchors.way == "package" and found.heads >= 24 and found.anchors.views >= 24 * 10
    assert found.anchors.absent == 0
    pairs = FACE_MESH.mirror_pairs()
    points = found.anchors.points
    assert fit_similarity(points[pairs] * [-1, 1, 1], points).rms < 0.5


def test_a_correction_of_the_package_is_held_against_it() -> None:
    [found] = packaged(FACE_MESH)
    points = found.anchors.points
    right = found.correction
    sd = found.correction_sd_deg
    assert not shared_levelling_problem("level", right, sd, [points], FACE_MESH, "package")
    turn = graphics_rotation(rotation_from_angles(np.array([0.0, 2.0, 0.0])))
    other = tuple((turn @ np.reshape(right, (3, 3))).reshape(-1).tolist())
    said = shared_levelling_problem("source", other, sd, [points], FACE_MESH, "package")
    assert said == "its correction is 2 degrees from what its anchors say"
    assert not shared_levelling_problem("level", other, sd, [points], FACE_MESH, "source"), "by detections"
    never = ((1.0, 0, 0, 0, 1, 0, 0, 0, 1), (float("nan"),) * 3)
    said = shared_levelling_problem("level", *never, [points], FACE_MESH, "source")
    assert said == "its pose zero is level, but it was never levelled"


def test_anchors_of_a_subject_are_those_of_its_other_expressions() -> None:
    mesh = face_mesh()
    own = found_on(mesh, 1.0).anchors
    other = of_subject(mesh.triangles, own)
    assert other.mesh == mesh_key(mesh.triangles) and other.anchors.way == "subject"
    smiling = face_mesh(1.1)
    assert find_known(smiling, [other], FACE_MESH) is other
    placement = stand_known(HEAD, smiling, other, FACE_MESH)
    np.testing.assert_array_equal(anchors_on(smiling, placement, other).weights, own.weights)


@pytest.mark.skipif(not CANONICAL_FACE.exists(), reason="the detector's model face is not here")
def test_level_is_what_the_detectors_own_model_face_reads() -> None:
    """The package has only one number of it, and it is enough: on photographs the two fits agree."""
    model = np.loadtxt(CANONICAL_FACE, delimiter=",", comments="#") @ CAMERA_FROM_GRAPHICS
    fit = fit_similarity(model, FACE_MESH.reference_face() @ CAMERA_FROM_GRAPHICS).rotation
    assert abs(angles_from_rotation(fit)[1] - FACE_MESH.level_pitch_deg) < 1e-3
    known = np.load(CANONICAL_FACE.with_name("aflw2000_even.npz"))
    near_front = (np.abs(known["ypr_deg"]) < [20, 15, 30]).all(axis=1) & known["detected"]
    off = [
        geodesic_deg(fit_similarity(model, points).rotation, detected_facing(points, FACE_MESH))
        for points in known["landmarks"][near_front].astype(np.float64)
    ]
    assert len(off) > 300 and np.max(off) < 0.3 and np.mean(off) < 0.08
