# SPDX-License-Identifier: MIT
"""The decomposition, its curves and what fills its holes, to the number where one is known."""

from __future__ import annotations

import threading
from dataclasses import replace

import ideal
import numpy as np
import pytest

from downstream_hpe.errors import DataError, ModelError
from downstream_hpe.manifold import cosines as curves
from downstream_hpe.manifold import missing_cells, reconstruction, tucker
from downstream_hpe.manifold.cosines import Manifolds, cosines, fit_cosines, fourier_start
from downstream_hpe.manifold.decomposition import decompose
from downstream_hpe.manifold.reconstruction import ReconstructionEstimator
from downstream_hpe.manifold.rowspace import RowSpace
from downstream_hpe.manifold.slabs import ArrayTensor
from downstream_hpe.manifold.tensor_model import FORMAT, TensorModel
from downstream_hpe.model_file import packed


@pytest.fixture(scope="module")
def clean():
    return ideal.tensor(ideal.Faces().draw(6, np.random.default_rng(1)))


def holed(tensor, *places):
    """Without the cells at these places, (head, yaw, pitch, roll); slice(None) for all heads."""
    observed = tensor.observed.copy()
    for place in places:
        observed[place] = False
    return ArrayTensor(np.where(observed[..., None], tensor.values, np.nan), observed)


# ---- curves -------------------------------------------------------------


@pytest.mark.parametrize("turns", [1, 2])
def test_the_fourier_start_is_the_frequency_of_whole_waves(turns):
    """So many waves over the samples, which end one step before the first would come again."""
    angles = np.linspace(-135, 135, 28)  # a step of 10 degrees, 280 in all with the last step
    beta = turns * 360 / 280
    column = 5.0 + np.cos(beta * np.deg2rad(angles) + 0.4)
    alpha, found, gamma, phi = fourier_start(column, angles)
    assert found == pytest.approx(beta)
    np.testing.assert_allclose([alpha, gamma, phi], [1, 0.4, 5], atol=1e-9)


def test_least_and_largest_frequencies():
    angles = np.deg2rad(np.linspace(-30, 30, 7))
    assert curves._bounds(angles) == pytest.approx((0.25 / np.deg2rad(60), 3.0))
    coarse = np.deg2rad(np.array([-120.0, 0, 90, 180]))
    assert curves._bounds(coarse) == pytest.approx((0.25 / np.deg2rad(300), 0.75 * np.pi / np.deg2rad(90)))
    assert pytest.approx(np.rad2deg(0.25 / 3)) == curves.NARROWEST_DEG


@pytest.mark.parametrize("shape", [(5,), (5, 2, 1), (4, 2)])
def test_a_factor_of_another_shape_is_refused(shape):
    with pytest.raises(DataError, match=r"expected a factor \[D, K\] and D angles"):
        fit_cosines(np.ones(shape), np.arange(0.0, 50, 10))


def test_amplitude_is_not_negative_and_the_phase_is_the_nearest():
    angles = np.linspace(-40, 40, 9)
    true = np.array([[1.5, 1.2, 3.0, 0.2], [1.5, 1.2, -3.0, 0.2]])
    found = fit_cosines(cosines(true, angles), angles)
    assert (found[:, 0] > 0).all() and (np.abs(found[:, 2]) <= np.pi).all()
    np.testing.assert_allclose(found, true, atol=1e-5)
    # Four samples are enough, and a column of one value is itself.
    few = np.array([-60.0, -20, 20, 60])
    np.testing.assert_allclose(fit_cosines(np.full((4, 1), 2.5), few), [[0, 1, 0, 2.5]], atol=1e-12)


@pytest.mark.parametrize("scale", [1e-20, 1e-3, 1e6])
def test_curves_do_not_depend_on_the_unit_of_a_column(scale):
    angles = np.linspace(-40, 40, 9)
    true = np.array([[1.5, 1.2, 3.0, 0.2], [0.8, 2.0, -1.0, -0.4]])
    found = fit_cosines(scale * cosines(true, angles), angles)
    np.testing.assert_allclose(found / [scale, 1, 1, scale], true, atol=1e-4)


def test_the_curve_of_shaken_values_is_the_best_of_all_frequencies():
    rng = np.random.default_rng(0)
    angles = np.linspace(-80, 80, 17)
    true = np.stack([rng.uniform(*ends, 40) for ends in ((0.5, 2), (0.3, 2.95), (-3, 3), (-1, 1))], axis=1)
    columns = cosines(true, angles) + 0.2 * rng.normal(size=(17, 40))
    lost = ((cosines(fit_cosines(columns, angles), angles) - columns) ** 2).sum(axis=0)
    phase = np.linspace(*curves._bounds(np.deg2rad(angles)), 2000)[:, None] * np.deg2rad(angles)
    bases, _ = np.linalg.qr(np.stack([np.cos(phase), np.sin(phase), np.ones_like(phase)], axis=-1))
    explained = np.square(np.einsum("bdk,dc->bkc", bases, columns)).sum(axis=1)
    assert (lost <= (np.square(columns).sum(axis=0) - explained).min(axis=0) * (1 + 1e-9)).all()


# ---- the decomposition --------------------------------------------------


def test_columns_are_turned_the_same_way(clean):
    """Each factor's sum of i a_i, counted from 1, is positive, and the core with them."""
    fit = decompose(clean)
    for factor in (fit.identity, *fit.poses):
        assert (np.arange(1, len(factor) + 1) @ factor > 0).all()
        np.testing.assert_allclose(factor.T @ factor, np.eye(factor.shape[1]), atol=1e-9)
    np.testing.assert_allclose(fit.slab(2), clean.values[2], atol=1e-6)
    # Of ideal faces nothing is lost on the way, so that each mode has the energies of the whole tensor.
    total = np.square(clean.values).sum()
    for mode, energies in enumerate(fit.energies):
        unfolded = np.moveaxis(clean.values, mode, 0).reshape(clean.shape[mode], -1)
        expected = np.linalg.svd(unfolded, compute_uv=False) ** 2 / total
        count = min(len(energies), len(expected))
        np.testing.assert_allclose(energies[:count], expected[:count], atol=1e-6)
    assert fit.relative_error < 1e-6


def test_a_tensor_is_read_once_where_it_fits_into_memory_and_else_once_a_factor(clean, monkeypatch):
    reads = []

    class Counted(ArrayTensor):
        def slabs(self):
            reads.append(1)
            return super().slabs()

    fit = decompose(Counted(clean.values, clean.observed))
    assert fit.passes == len(reads) == 1
    reads.clear()
    assert decompose(Counted(clean.values, clean.observed), refinements=2).passes == len(reads) == 5
    reads.clear()
    monkeypatch.setattr(tucker, "KEPT_BYTES", 0)
    assert decompose(Counted(clean.values, clean.observed)).passes == len(reads) == 4


@pytest.mark.parametrize(("heads", "reads"), [(6.0, 1), (5.9, 2), (3.6, 2), (3.5, 3)])
def test_as_soon_as_all_heads_fit_they_are_kept(clean, monkeypatch, heads, reads):
    """Of 5 yaw angles 3 columns are left after the first reading, so that 6 heads take the room of 3.6."""
    monkeypatch.setattr(tucker, "KEPT_BYTES", round(heads * clean.values[0].nbytes))
    assert decompose(clean).passes == reads


def test_some_heads_are_worked_on_at_once_and_as_many_wait(monkeypatch):
    monkeypatch.setattr(tucker, "THREADS", 2)
    together, taken = threading.Barrier(2, timeout=10), []

    def heads():
        for head in range(8):
            taken.append(head)
            yield head

    found = tucker._in_threads(lambda head: together.wait() * 0 + head, heads())
    assert next(found) == 0 and taken == [0, 1, 2, 3, 4]
    assert list(found) == [1, 2, 3, 4, 5, 6, 7]


def test_rows_are_merged_a_block_at_a_time(monkeypatch):
    merged, merge = [], RowSpace._merge

    def noted(space, keep):
        merged.append((len(space._rows), keep))
        return merge(space, keep)

    monkeypatch.setattr(RowSpace, "_merge", noted)
    space = RowSpace(keep=4, block=8)
    for row in np.random.default_rng(0).normal(size=(31, 20)):
        space.add(row)
    assert merged == [(12, 4), (8, 4), (8, 4)]
    space.finish(2)
    assert merged[3:] == [(3, 2)]


@pytest.mark.parametrize("keep", [4, 200])
def test_rows_are_exact_below_keep_and_block(keep):
    """At any block: with keep below the rank the energy that is left out is counted."""
    rng = np.random.default_rng(3)
    matrix = (
        rng.normal(size=(40, 12)) * [9, 8, 7, 6, *[0.1] * 8] @ np.linalg.qr(rng.normal(size=(30, 12)))[0].T
    )
    space = RowSpace(keep=keep, block=8)
    for row in matrix:
        space.add(row)
    left, singular, right = space.finish(4)
    expected = np.linalg.svd(matrix, compute_uv=False)
    np.testing.assert_allclose(singular[:4], expected[:4], rtol=1e-3)
    np.testing.assert_allclose(left.T @ left, np.eye(4), atol=1e-8)
    np.testing.assert_allclose(right @ right.T, np.eye(4), atol=1e-3)
    exact = keep == 200
    assert space.dropped == pytest.approx((expected[4:] ** 2).sum(), rel=1e-6 if exact else 0.3)
    with pytest.raises(ValueError, match="without rows"):
        RowSpace().finish(1)


def test_rows_of_any_unit_have_directions_of_length_one_and_none_where_there_is_nothing():
    rng = np.random.default_rng(3)
    matrix = 1e-6 * rng.normal(size=(9, 2)) @ rng.normal(size=(2, 30))
    space = RowSpace()
    for row in [*matrix, np.zeros(30)]:
        space.add(row)
    left, singular, right = space.finish(2)
    np.testing.assert_allclose(right @ right.T, np.eye(2), atol=1e-6)
    np.testing.assert_allclose(left * singular[:2] @ right, [*matrix, np.zeros(30)], atol=1e-12)
    nothing = RowSpace()
    nothing.add(np.zeros(3))
    assert not nothing.finish(1)[2].any()


# ---- holes --------------------------------------------------------------


def test_missing_cells_come_back_and_every_reading_is_counted(clean):
    tensor = holed(clean, (0, 1, 2, 3), (4, 0, 0, 0))
    reads, errors = [], []

    class Counted(ArrayTensor):
        def slabs(self):
            reads.append(1)
            return super().slabs()

    counted = Counted(tensor.values, tensor.observed)
    fit = decompose(counted, progress=lambda n, error: errors.append((n, error)))
    assert [n for n, _ in errors] == list(range(1, len(errors) + 1))
    assert fit.relative_error == errors[-1][1] < 1e-3
    assert fit.passes == len(reads)
    for place in ((0, 1, 2, 3), (4, 0, 0, 0)):
        true = clean.values[place]
        assert np.linalg.norm(fit.slab(place[0])[place[1:]] - true) < 0.01 * np.linalg.norm(true)


def test_the_mean_head_is_that_of_whoever_has_a_cell(clean):
    tensor = holed(clean, (0, 1, 2, 3), (1, 1, 2, 3))
    mean = missing_cells._mean_head(tensor, (3, 3, 3, 3), 1e-5, 50)
    np.testing.assert_allclose(mean[1, 2, 3], clean.values[2:, 1, 2, 3].mean(axis=0))
    np.testing.assert_allclose(mean[0, 0, 0], clean.values[:, 0, 0, 0].mean(axis=0))


def test_a_cell_that_nobody_has_is_completed_and_of_a_single_head_the_mean(clean):
    tensor = holed(clean, (slice(None), 0, 0, 0))
    mean = missing_cells._mean_head(tensor, (3, 3, 3, 3), 1e-7, 200)
    true = clean.values[:, 0, 0, 0].mean(axis=0)
    assert np.linalg.norm(mean[0, 0, 0] - true) < 0.05 * np.linalg.norm(true)
    np.testing.assert_allclose(mean[1, 1, 1], clean.values[:, 1, 1, 1].mean(axis=0))
    one = holed(ArrayTensor(clean.values[:1], clean.observed[:1]), (0, 0, 0, 0))
    start = missing_cells._mean_head(one, (1, 3, 3, 3), 1e-5, 50)
    np.testing.assert_allclose(start[0, 0, 0], one.values[0][one.observed[0]].mean(axis=0))


# ---- poses from landmarks -----------------------------------------------


@pytest.fixture(scope="module")
def estimator(clean):
    fit = decompose(clean)
    return ReconstructionEstimator(fit.core, curves.fit_manifolds(fit, ideal.AXES))


def test_it_is_searched_half_a_range_past_either_end_and_no_farther(estimator):
    low, high = estimator.manifolds.range_deg.T
    np.testing.assert_allclose(estimator._low, low - (high - low) / 2)
    np.testing.assert_allclose(estimator._high, high + (high - low) / 2)
    lopsided = Manifolds(
        estimator.manifolds.params, estimator.manifolds.range_deg + np.array([[7.0], [0], [0]])
    )
    moved = ReconstructionEstimator(np.ones((1, 3, 3, 3, 1404)), lopsided)
    np.testing.assert_allclose(moved._low - estimator._low, [7, 0, 0], atol=1e-9)


def test_nothing_has_the_shapes_of_something(estimator):
    none = estimator.estimate(np.empty((0, 1404)))
    some = estimator.from_landmarks(ideal.Faces().draw(2, np.random.default_rng(0)))
    for empty, full in zip(vars(none).values(), vars(some).values(), strict=True):
        assert empty.shape == (0, *full.shape[1:]) and empty.dtype == full.dtype


def test_what_is_not_there_after_the_last_step_has_not_converged(estimator):
    rng = np.random.default_rng(5)
    ypr = rng.uniform(-20, 20, (4, 3))
    features = reconstruction.normalise(ideal.turned(ideal.Faces().draw(4, rng), ypr)).reshape(4, -1)
    assert not estimator.estimate(features, max_steps=1).converged.any()
    found = estimator.estimate(features)
    assert found.converged.all()
    np.testing.assert_allclose(found.ypr_deg, ypr, atol=0.01)


# ---- what is kept of it -------------------------------------------------


@pytest.fixture
def model(clean):
    return TensorModel.of(decompose(clean), ideal.AXES, np.arange(1404.0).reshape(468, 3), "eyes")


def test_a_tensor_model_is_read_back_bit_by_bit(model, tmp_path):
    model.save(tmp_path / "m.safetensors")
    again = TensorModel.load(tmp_path / "m.safetensors")
    assert again.normalisation == again.estimator().normalisation == "eyes"
    for name in ("core", "reference"):
        np.testing.assert_array_equal(getattr(again, name), getattr(model, name))
    for of in (lambda m: m.axes_deg, lambda m: m.poses, lambda m: m.manifolds.params):
        for ours, theirs in zip(of(again), of(model), strict=True):
            np.testing.assert_array_equal(ours, theirs)
    np.testing.assert_array_equal(again.manifolds.range_deg, model.manifolds.range_deg)
    np.testing.assert_array_equal(again.manifolds.range_deg, [[axis[0], axis[-1]] for axis in ideal.AXES])


def test_a_tensor_model_whose_arrays_do_not_belong_together_is_refused(model, tmp_path):
    yaw, pitch, roll = model.manifolds.params
    for spoiled in (
        replace(model, normalisation="inches"),
        replace(model, core=model.core[0]),
        replace(model, core=model.core[:, :, :2]),
        replace(model, core=model.core.reshape(model.core.shape[0], *model.core.shape[1:3], -1)),
        replace(model, manifolds=replace(model.manifolds, params=(yaw, pitch, roll[:2]))),
        replace(model, manifolds=replace(model.manifolds, params=(yaw[:, :3], pitch, roll))),
    ):
        spoiled.save(tmp_path / "m.safetensors")
        with pytest.raises(ModelError, match="its arrays do not belong together"):
            TensorModel.load(tmp_path / "m.safetensors")


def test_a_tensor_model_without_one_of_its_arrays_is_refused(tmp_path):
    from safetensors.numpy import save_file

    save_file({"core": np.ones(3)}, tmp_path / "m.safetensors", metadata=packed(FORMAT, {}))
    with pytest.raises(ModelError, match=r"no array 'yaw\.axis_deg'; fit the model again"):
        TensorModel.load(tmp_path / "m.safetensors")
