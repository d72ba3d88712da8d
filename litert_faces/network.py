# SPDX-License-Identifier: MIT
"""A TFLite file at work. Needs ai-edge-litert."""

from __future__ import annotations

import numpy as np

from litert_faces.errors import FinderError
from litert_faces.quiet import silence


class Network:
    """One picture in, all outputs out.

    content: of a .tflite file. name: of the file, for messages. size: side of the square it wants.
    Raises FinderError: ai-edge-litert is missing, or the file is no network of that kind.
    """

    def __init__(self, content: bytes, name: str) -> None:
        try:
            from ai_edge_litert.interpreter import Interpreter
        except ImportError as error:
            raise FinderError(f"LiteRT cannot be loaded ({error}): pip install 'headturn[litert]'") from error
        self.name = name
        try:
            with silence():  # LiteRT greets with the name of its delegate
                self._interpreter = Interpreter(model_content=content, num_threads=1)
                self._interpreter.allocate_tensors()
        except (ValueError, RuntimeError) as error:
            reason = str(error).strip().partition("\n")[0]
            raise FinderError(f"{name}: LiteRT cannot run it ({reason})") from error
        inputs, self._outputs = self._interpreter.get_input_details(), self._interpreter.get_output_details()
        shape = tuple(inputs[0]["shape"].tolist()) if len(inputs) == 1 else ()
        if len(shape) != 4 or shape != (1, shape[1], shape[1], 3) or inputs[0]["dtype"] != np.float32:
            raise FinderError(f"{name}: does not take one square picture in RGB")
        self._input, self.size = inputs[0]["index"], int(shape[1])

    @property
    def sizes(self) -> tuple[int, ...]:
        """How many numbers each output has."""
        return tuple(int(np.prod(output["shape"])) for output in self._outputs)

    def __call__(self, picture: np.ndarray) -> list[np.ndarray]:
        """float32 [1, size, size, 3] -> every output, float32, flat."""
        self._interpreter.set_tensor(self._input, picture)
        self._interpreter.invoke()
        return [self._interpreter.get_tensor(output["index"]).ravel() for output in self._outputs]
