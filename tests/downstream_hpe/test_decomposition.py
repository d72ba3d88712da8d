# SPDX-License-Identifier: MIT
from __future__ import annotations

import weakref

import ideal
import numpy as np
import pytest

from downstream_hpe.errors import DataError
from downstream_hpe.manifold import tucker
from downstream_hpe.manifold.decomposition import decompose
from downstream_hpe.manifold.rowspace import RowSpace
from downstream_hpe.manifold.slabs import ArrayTensor


@pytest.fixture(scope="module")
def clean():
    return ideal.tensor(ideal.Faces().draw(9, np.random.default_rng(1)))


@pytest.fixture(scope="module")
def noisy():
    rng = np.random.default_rng(2)
    return ideal.tensor(ideal.Faces().draw(9, rng), noise=0.02, rng=rng)


def relative_error(tensor, fit):
    fitted = np.stack([fit.slab(n) for n in range(tensor.shape[0])])
    return np.linalg.norm(fitted - tensor.values) / np.linalg.norm(tensor.values)


def test_ideal_poses_have_rank_three(clean):
    fit = decompose(clean)
    assert relative_error(clean, fit) < 1e-12
    for energies in fit.energies[1:]:
        assert energies[2] > 1e-5
        assert energies[3:].max() < 1e-12
        np.testing.assert_allclose(energies.sum(), 1.0)
    for factor in (fit.identity, *fit.poses):
        np.testing.assert_allclose(factor.T @ factor, np.eye(factor.shape[1]), atol=1e-10)


def test_relative_error_is_the_true_one(noisy):
    fit = decompose(noisy)
    np.testing.assert_allclose(fit.relative_error, relative_error(noisy, fit), rtol=1e-9)
    refined = decompose(noisy, refinements=2)
    np.testing.assert_allclose(refined.relative_error, relative_error(noisy, refined), rtol=1e-6)
    assert refined.relative_error < fit.relative_error


def test_refined_factors_are_the_best_beside_each_other(noisy):
    """Each spans the leading vectors of the tensor contracted with the other three."""
    fit = decompose(noisy, refinements=2)
    factors = (fit.identity, *fit.poses)
    for mode, factor in enumerate(factors):
        left = noisy.values
        for other in {*range(4)} - {mode}:
            left = np.moveaxis(np.tensordot(factors[other].T, left, (1, other)), 0, other)
        unfolded = np.moveaxis(left, mode, 0).reshape(len(factor), -1)
        best = np.linalg.svd(unfolded, full_matrices=False)[0][:, : factor.shape[1]]
        np.testing.assert_allclose(np.linalg.svd(best.T @ factor, compute_uv=False), 1, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("refinements", [0, 3])
def test_agrees_with_tensorly(noisy, refinements):
    peer = pytest.importorskip("tensorly.decomposition")
    modes = [0, 1, 2, 3]
    (_, factors), errors = peer.partial_tucker(noisy.values, (5, 3, 3, 3), modes=modes, tol=1e-9)
    fit = decompose(noisy, refinements=refinements)
    assert abs(fit.relative_error - float(errors[-1])) < 1e-4
    for ours, theirs in zip(fit.poses, factors[1:], strict=True):
        cosines = np.linalg.svd(ours.T @ theirs, compute_uv=False)
        assert cosines.min() > 0.999


def test_signs_do_not_depend_on_the_run(noisy, monkeypatch):
    first = decompose(noisy)
    monkeypatch.setattr(tucker, "KEPT_BYTES", 0)  # read every pass, as with many heads
    flipped = np.linalg.eigh
    monkeypatch.setattr(np.linalg, "eigh", lambda a: (flipped(a)[0], -flipped(a)[1]))
    second = decompose(noisy)
    assert (first.passes, second.passes) == (1, 4)
    for one, other in zip((first.core, *first.poses), (second.core, *second.poses), strict=True):
        np.testing.assert_allclose(one, other, atol=1e-8 * np.abs(one).max())


def test_threads_change_no_bit(noisy, monkeypatch):
    several = decompose(noisy)
    monkeypatch.setattr(tucker, "THREADS", 1)
    single = decompose(noisy)
    for one, other in zip((several.core, *several.poses), (single.core, *single.poses), strict=True):
        np.testing.assert_array_equal(one, other)


def test_only_a_few_heads_are_in_memory_at_once(noisy, monkeypatch):
    class Streamed(ArrayTensor):
        def slabs(self):
            heads = []
            for slab in self.values:
                heads.append(weakref.ref(fresh := slab.copy()))
                yield fresh
                del fresh
                alive.append(sum(head() is not None for head in heads))

    alive: list[int] = []
    monkeypatch.setattr(tucker, "KEPT_BYTES", 0)
    monkeypatch.setattr(tucker, "THREADS", 2)
    decompose(Streamed(noisy.values, noisy.observed))
    assert max(alive) <= 2 * 2 + 2  # and the one that is read, and the one that was handed over


@pytest.mark.slow
def test_missing_cells_are_recovered(clean):
    rng = np.random.default_rng(3)
    observed = rng.random(clean.shape[:4]) > 0.1
    observed[:, 0, 0, 0] = observed[:, -1, -1, 0] = False  # corners that no head has
    holed = ArrayTensor(np.where(observed[..., None], clean.values, np.nan), observed)
    rounds = []
    fit = decompose(holed, progress=lambda n, error: rounds.append(error))
    assert rounds[-1] < rounds[0]
    for head in range(2):
        hole = ~observed[head]
        true = clean.values[head][hole]
        assert np.linalg.norm(fit.cells(head, hole) - true) < 2e-3 * np.linalg.norm(true)
        np.testing.assert_allclose(fit.cells(head, hole), fit.slab(head)[hole], atol=1e-12)


def test_missing_cells_that_do_not_converge_say_so(clean):
    observed = clean.observed.copy()
    observed[0, 0, 0, 0] = False
    rounds = []
    with pytest.raises(DataError, match="did not converge in 1 rounds"):
        decompose(ArrayTensor(clean.values, observed), max_rounds=1, progress=lambda n, _: rounds.append(n))
    assert rounds == [1]


def test_what_cannot_be_decomposed_is_refused(clean):
    with pytest.raises(DataError, match="5 roll angles on the grid, too few for rank 6"):
        decompose(clean, (5, 3, 3, 6))
    with pytest.raises(DataError, match="9 heads, too few for rank 10"):
        decompose(clean, (10, 3, 3, 3))
    with pytest.raises(DataError, match="rank 0"):
        decompose(clean, (5, 3, 0, 3))
    assert decompose(clean, (9, 5, 5, 5)).core.shape == (9, 5, 5, 5, 1404), "all that there is"
    assert decompose(clean, (1, 1, 1, 1)).core.shape == (1, 1, 1, 1, 1404)
    observed = clean.observed.copy()
    observed[:, 2] = False
    with pytest.raises(DataError, match="no landmarks at all for yaw number 2"):
        decompose(ArrayTensor(clean.values, observed))


def test_rows_beyond_the_block_are_merged():
    rng = np.random.default_rng(4)
    matrix = rng.normal(size=(60, 6)) * [9, 7, 5, 3, 0.01, 0.01] @ rng.normal(size=(6, 300))
    space = RowSpace(keep=8, block=8)
    for row in matrix:
        space.add(row)
    left, singular, right = space.finish(4)
    expected = np.linalg.svd(matrix, compute_uv=False)
    np.testing.assert_allclose(singular[:4], expected[:4], rtol=1e-9)
    np.testing.assert_allclose(left * singular[:4] @ right, matrix, atol=1)
    assert np.linalg.norm(left * singular[:4] @ right - matrix) < 1.01 * np.linalg.norm(expected[4:])
