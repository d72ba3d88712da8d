# SPDX-License-Identifier: MIT
"""Speed, error and memory of the decomposition beside tensorly's, in one run.

    python benchmarks/decompose.py                 # both parts
    python benchmarks/decompose.py --heads 1000    # how many heads the memory part streams

Faces are synthetic: five shape components, small deviations of shape, detector-like noise.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator

import numpy as np

from downstream_hpe.decomposition import PAPER_RANKS, Decomposition, decompose
from downstream_hpe.normalise import FEATURES, normalise
from downstream_hpe.rotation import rotation_from_angles
from downstream_hpe.tensor import ArrayTensor

AXES = (np.arange(-50, 51, 10), np.arange(-40, 41, 10), np.arange(-30, 31, 10))
NOISE = 0.01


class SyntheticTensor:
    """Heads x 11 x 9 x 7 x 1404, float32, made head by head: never whole in memory."""

    def __init__(self, heads: int) -> None:
        grid = np.stack(np.meshgrid(*AXES, indexing="ij"), axis=-1)
        self.shape = (heads, *grid.shape[:3], FEATURES)
        self.observed = np.ones(self.shape[:4], dtype=bool)
        self._rotation = rotation_from_angles(grid).astype(np.float32)
        self._shapes = np.random.default_rng(0).normal(size=(6, FEATURES // 3, 3))
        self._noise = np.random.default_rng(1).normal(scale=NOISE, size=self.shape[1:]).astype(np.float32)

    def slabs(self) -> Iterator[np.ndarray]:
        rng = np.random.default_rng(2)
        for _ in range(self.shape[0]):
            weights = np.array([1.0, *rng.normal(scale=0.15, size=5)])
            face = normalise(np.tensordot(weights, self._shapes, 1)).astype(np.float32)
            slab = np.einsum("abcij,nj->abcni", self._rotation, face, optimize=True)
            # One field of noise, rolled: as rough as fresh noise and a hundred times cheaper.
            yield slab.reshape(self.shape[1:]) + np.roll(self._noise, rng.integers(FEATURES), axis=-1)


def relative_error(values: np.ndarray, fitted: Iterator[np.ndarray]) -> float:
    lost = sum(float(np.square(a - b, dtype=np.float64).sum()) for a, b in zip(values, fitted, strict=True))
    return float(np.sqrt(lost / np.square(values, dtype=np.float64).sum()))


def compare(heads: int) -> bool:
    import tensorly
    from tensorly.decomposition import partial_tucker
    from tensorly.tenalg import multi_mode_dot

    values = np.stack(list(SyntheticTensor(heads).slabs()))
    tensor = ArrayTensor(values, np.ones(values.shape[:4], dtype=bool))
    print(f"tensor {' x '.join(map(str, values.shape))} {values.dtype}, {values.nbytes / 1e6:.0f} MB")
    times = []
    for _ in range(3):
        start = time.perf_counter()
        ours: Decomposition = decompose(tensor)
        times.append(time.perf_counter() - start)
    seconds = min(times)
    error = relative_error(values, (ours.slab(n) for n in range(heads)))
    print(f"{'streamed ST-HOSVD':32} {seconds:8.2f} s   error {error:.6f}")
    ratios = []
    cases = [("start only (HOSVD)", {"n_iter_max": 1}), ("as it comes (HOOI)", {})]
    for name, options in cases:
        start = time.perf_counter()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            (core, factors), _ = partial_tucker(values, PAPER_RANKS, modes=[0, 1, 2, 3], **options)
        theirs = time.perf_counter() - start
        fitted = (
            multi_mode_dot(core, [factors[0][n : n + 1], *factors[1:]], modes=[0, 1, 2, 3])[0]
            for n in range(heads)
        )
        other = relative_error(values, fitted)
        ratios.append((theirs / seconds, abs(error - other)))
        print(
            f"{f'tensorly {tensorly.__version__} {name}':32} {theirs:8.2f} s   error {other:.6f}"
            f"   {theirs / seconds:6.1f}x slower, errors {error - other:+.1e} apart"
        )
    ratio, apart = ratios[-1]
    good = ratio >= 100 and apart <= 1e-4
    print(f"at least 100x faster within 1e-4: {'yes' if good else 'NO'} ({ratio:.0f}x, {apart:.1e})")
    return good


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--heads", type=int, default=1000, help="heads of the memory part")
    parser.add_argument("--compare-heads", type=int, default=60, help="heads of the comparison")
    parser.add_argument("--part", choices=["both", "compare", "memory"], default="both")
    options = parser.parse_args()
    if options.part == "memory":
        tensor = SyntheticTensor(options.heads)
        start = time.perf_counter()
        fit = decompose(tensor)
        seconds = time.perf_counter() - start
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
        whole = np.prod(tensor.shape, dtype=float) * 4
        print(
            f"{options.heads} heads ({whole / 1e9:.1f} GB if whole): {seconds:.0f} s with making them, "
            f"relative error {fit.relative_error:.4f}, peak memory {peak / 1e9:.2f} GB; "
            f"under 2 GB: {'yes' if peak < 2e9 else 'NO'}"
        )
        return 0 if peak < 2e9 else 1
    print(f"threads: OMP_NUM_THREADS={os.environ.get('OMP_NUM_THREADS', 'unset')}", flush=True)
    good = True
    if options.part == "both":
        # A fresh process, and first: Linux hands the peak of a parent down to its children.
        command = [sys.executable, __file__, "--part", "memory", "--heads", str(options.heads)]
        good = subprocess.run(command, check=False).returncode == 0
    good &= compare(options.compare_heads)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
