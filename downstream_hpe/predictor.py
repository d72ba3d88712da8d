# SPDX-License-Identifier: MIT
"""``from downstream_hpe.predictor import Predictor``, as model cards out there say it."""

from downstream_hpe.prediction.pose import Pose
from downstream_hpe.prediction.predictor import Predictor

__all__ = ["Pose", "Predictor"]
