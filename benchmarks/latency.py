# SPDX-License-Identifier: MIT
"""Time of one face through encoder and heads (onnxruntime, batch 1, one thread) and the detector's.

python benchmarks/latency.py                # the shipped model; and the recipes' networks, untrained
python benchmarks/latency.py model.onnx     # another one
    --json FILE: write the shipped, or the other one's, median
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from results import Figure, write_json

from downstream_hpe.geometry.face_mesh import FEATURES
from downstream_hpe.geometry.mean_head import mean_head
from downstream_hpe.geometry.normalise import normalise
from downstream_hpe.networks.export import export_int8, export_onnx
from downstream_hpe.networks.pose_network import PoseNetwork
from downstream_hpe.networks.recipe import RECIPES
from downstream_hpe.networks.rigid_fit import FACTORS, RigidFit
from downstream_hpe.networks.weights import Weights
from downstream_hpe.prediction.predictor import MODELS, Predictor

RUNS = 2000
LIMIT_MS = 0.1


def median_ms(call: Callable[[], object], runs: int = RUNS) -> tuple[float, float]:
    """Median and 90th percentile of the wall time of a call, milliseconds."""
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        call()
        times.append(time.perf_counter() - start)
    low, high = np.percentile(times, [50, 90]) * 1e3
    return float(low), float(high)


def time_model(name: str, path: Path) -> float:
    predictor = Predictor.load(path, threads=1)
    landmarks = mean_head()[None].astype(np.float32)
    predictor.from_landmarks(landmarks)
    middle, high = median_ms(lambda: predictor.graph(landmarks))
    size = path.stat().st_size / 1e6
    print(f"{name:46} median {middle:7.3f} ms   90 % {high:7.3f} ms   {size:.1f} MB")
    whole, high = median_ms(lambda: predictor.from_landmarks(landmarks))
    print(f"{'  and whether it is a face':46} median {whole:7.3f} ms   90 % {high:7.3f} ms")
    return middle


def time_detector() -> None:
    try:
        from mediapipe.python.solutions.face_mesh import FaceMesh
        from skimage.data import astronaut
    except ImportError as error:
        print(f"landmark detector: not timed, {error.name} is not installed")
        return
    image = astronaut()
    with FaceMesh(static_image_mode=True, max_num_faces=1) as detector:
        detector.process(image)
        middle, high = median_ms(lambda: detector.process(image), runs=50)
    print(f"{'MediaPipe Face Mesh, 512 x 512':46} median {middle:7.3f} ms   90 % {high:7.3f} ms")


def time_recipes() -> None:
    """The graphs a fit writes, with random weights: the same graph, the same time."""
    ranges = np.array([[-50.0, 50], [-40, 40], [-30, 30]])
    face, curves = normalise(mean_head()).reshape(-1), np.ones((FACTORS, 4))
    with tempfile.TemporaryDirectory() as folder:
        for name, recipe in RECIPES.items():
            whole, small = Path(folder) / f"{name}.onnx", Path(folder) / f"{name}-int8.onnx"
            basis = np.zeros((FEATURES, recipe.components))
            rigid = RigidFit(face, basis, curves) if recipe.continuous else None
            network = PoseNetwork(recipe.layers, recipe.head_layers, rigid=rigid)
            weights = Weights(network.eval(), "rms", ranges)
            export_onnx(weights, whole)
            time_model(f"{name}: {'-'.join(map(str, recipe.layers))}", whole)
            if rigid is None:
                export_int8(weights, small)
                time_model(f"{name}, 8 bits", small)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", nargs="?", help="an .onnx file")
    parser.add_argument("--json", type=Path, help="write what was measured, for history.py")
    asked = parser.parse_args()
    if asked.model is not None:
        middle = time_model(asked.model, Path(asked.model))
    else:
        middle = time_model("shipped: headturn", MODELS / "headturn.onnx")
        time_recipes()
    time_detector()
    write_json(asked.json, "latency.py", [Figure(asked.model or "headturn.onnx, a face", middle, "ms")])
    print(f"at most {LIMIT_MS} ms: {'yes' if middle <= LIMIT_MS else 'NO'} ({middle:.3f} ms)")
    return 0 if middle <= LIMIT_MS else 1


if __name__ == "__main__":
    sys.exit(main())
