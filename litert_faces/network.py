# SPDX-License-Identifier: MIT
"""A TFLite file at work. Needs ai-edge-litert."""

from __future__ import annotations

import numpy as np

from litert_faces.errors import FinderError
from litert_faces.installing import install_with_these
from litert_faces.quiet import silence


class Network:
    """One array in, all outputs out.

    content: of a .tflite file. name: of the file, for messages. shape: what it takes, float32.
    Raises FinderError: ai-edge-litert is missing, or the file is no network of that kind.
    """

    def __init__(self, content: bytes, name: str) -> None:
        try:
            from ai_edge_litert.interpreter import Interpreter
        except ImportError as error:
            raise FinderError(f"LiteRT cannot be loaded ({error}): {install_with_these('litert')}") from error
        self.name = name
        try:
            with silence():  # LiteRT greets with the name of its delegate
                self._interpreter = Interpreter(model_content=content, num_threads=1)
                self._interpreter.allocate_tensors()
        except (ValueError, RuntimeError) as error:
            reason = str(error).strip().partition("\n")[0]
            raise FinderError(f"{name}: LiteRT cannot run it ({reason})") from error
        inputs, self._outputs = self._interpreter.get_input_details(), self._interpreter.get_output_details()
        if len(inputs) != 1 or inputs[0]["dtype"] != np.float32:
            raise FinderError(f"{name}: does not take one array of float32")
        self._input, self.shape = inputs[0]["index"], tuple(map(int, inputs[0]["shape"]))

    @property
    def sizes(self) -> tuple[int, ...]:
        """How many numbers each output has."""
        return tuple(int(np.prod(output["shape"])) for output in self._outputs)

    def __call__(self, array: np.ndarray) -> list[np.ndarray]:
        """float32 of its shape -> every output, float32, flat."""
        self._interpreter.set_tensor(self._input, array)
        self._interpreter.invoke()
        return [self._interpreter.get_tensor(output["index"]).ravel() for output in self._outputs]


class PictureNetwork(Network):
    """One that takes a square picture, float32 [1, size, size, 3]."""

    def __init__(self, content: bytes, name: str) -> None:
        super().__init__(content, name)
        if len(self.shape) != 4 or self.shape != (1, self.shape[1], self.shape[1], 3):
            raise FinderError(f"{name}: does not take one square picture in RGB")
        self.size = self.shape[1]
