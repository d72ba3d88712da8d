# SPDX-License-Identifier: MIT
"""What a face does, in 52 numbers: the network of blendshapes that a face_landmarker.task carries."""

from __future__ import annotations

import numpy as np

from litert_faces.errors import FinderError
from litert_faces.landmarks import WITH_IRISES
from litert_faces.network import Network

NAMES = (
    "_neutral", "browDownLeft", "browDownRight", "browInnerUp", "browOuterUpLeft", "browOuterUpRight",
    "cheekPuff", "cheekSquintLeft", "cheekSquintRight", "eyeBlinkLeft", "eyeBlinkRight", "eyeLookDownLeft",
    "eyeLookDownRight", "eyeLookInLeft", "eyeLookInRight", "eyeLookOutLeft", "eyeLookOutRight",
    "eyeLookUpLeft", "eyeLookUpRight", "eyeSquintLeft", "eyeSquintRight", "eyeWideLeft", "eyeWideRight",
    "jawForward", "jawLeft", "jawOpen", "jawRight", "mouthClose", "mouthDimpleLeft", "mouthDimpleRight",
    "mouthFrownLeft", "mouthFrownRight", "mouthFunnel", "mouthLeft", "mouthLowerDownLeft",
    "mouthLowerDownRight", "mouthPressLeft", "mouthPressRight", "mouthPucker", "mouthRight", "mouthRollLower",
    "mouthRollUpper", "mouthShrugLower", "mouthShrugUpper", "mouthSmileLeft", "mouthSmileRight",
    "mouthStretchLeft", "mouthStretchRight", "mouthUpperUpLeft", "mouthUpperUpRight", "noseSneerLeft",
    "noseSneerRight",
)  # fmt: skip
"""In the order of the network's output; left and right are the subject's own. ARKit's names, without its
tongueOut; _neutral, which MediaPipe says to ignore, is first. MediaPipe's face_blendshapes_graph.cc."""
TAKES = (
    0, 1, 4, 5, 6, 7, 8, 10, 13, 14, 17, 21, 33, 37, 39, 40, 46, 52, 53, 54, 55, 58, 61, 63, 65, 66, 67, 70,
    78, 80, 81, 82, 84, 87, 88, 91, 93, 95, 103, 105, 107, 109, 127, 132, 133, 136, 144, 145, 146, 148, 149,
    150, 152, 153, 154, 155, 157, 158, 159, 160, 161, 162, 163, 168, 172, 173, 176, 178, 181, 185, 191, 195,
    197, 234, 246, 249, 251, 263, 267, 269, 270, 276, 282, 283, 284, 285, 288, 291, 293, 295, 296, 297, 300,
    308, 310, 311, 312, 314, 317, 318, 321, 323, 324, 332, 334, 336, 338, 356, 361, 362, 365, 373, 374, 375,
    377, 378, 379, 380, 381, 382, 384, 385, 386, 387, 388, 389, 390, 397, 398, 400, 402, 405, 409, 415, 454,
    466, *range(468, 478),
)  # fmt: skip
"""Points that the network is told, the irises among them; from the same file."""


class BlendshapeNetwork:
    """FinderError: the network does not take such points, or gives other numbers."""

    def __init__(self, network: Network) -> None:
        self._network = network
        if network.shape != (1, len(TAKES), 2) or network.sizes != (len(NAMES),):
            raise FinderError(
                f"{network.name}: no network of blendshapes, it takes {network.shape} and its outputs have "
                f"sizes {network.sizes}"
            )

    def scores(self, points: np.ndarray) -> np.ndarray:
        """0 to 1 each, in the order of NAMES: float32 [52]. points: [478, 3], pixels."""
        if points.shape != (WITH_IRISES, 3):
            raise FinderError(
                f"blendshapes are told from {WITH_IRISES} points of a face, got {points.shape}; those of its "
                "irises come with the points of a face_landmarker.task"
            )
        [scores] = self._network(points[list(TAKES), :2].astype(np.float32)[None])
        return scores
