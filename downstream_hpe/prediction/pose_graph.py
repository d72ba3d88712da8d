# SPDX-License-Identifier: MIT
"""An ONNX file of a model, checked and opened. Needs onnxruntime."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from downstream_hpe.errors import ModelError
from downstream_hpe.prediction import onnx_file
from downstream_hpe.prediction.onnx_file import FORMAT, SHAPES
from downstream_hpe.reading import parse_json, read_limited

EXPORT_AGAIN = "export it again with downstream-hpe export"


class PoseGraph:
    """What the model alone says of upright faces. Threads may share one.

    The file may come from anywhere: it is read as numbers and arithmetic only, see
    :mod:`downstream_hpe.prediction.onnx_file`. threads: of onnxruntime, for one call.

    outputs: names of what it gives. range_deg float [3, 2], trained_subjects, pose_zero: as its metadata say.
    takes_partial: whether landmarks may be NaN where they are not seen.
    ModelError: not there, not an ONNX file, or not one that `downstream-hpe export` wrote.
    """

    def __init__(self, file: Path, threads: int) -> None:
        self.file = file
        try:
            content = read_limited(file, onnx_file.MAX_BYTES)
        except ValueError as error:
            raise ModelError(
                f"{file}: larger than {onnx_file.MAX_BYTES / 1e6:.0f} MB; no model of this program"
            ) from error
        except OSError as error:
            raise ModelError(f"{file}: cannot be read ({error.strerror})") from error
        self._session = session = _open(file, content, threads)
        try:
            # What it calls a text need not be one.
            text = session.get_modelmeta().custom_metadata_map.get("downstream-hpe", "{}")
            values = [(v.name, v.type, v.shape[1:]) for v in (*session.get_inputs(), *session.get_outputs())]
            facts = parse_json(text)
            ranges = np.array(facts["range_deg"], dtype=np.float64)
            subjects = frozenset(map(str, facts["trained_subjects"]))
        except (KeyError, TypeError, ValueError) as error:
            raise ModelError(f"{file}: no downstream-hpe metadata; {EXPORT_AGAIN}") from error
        if facts.get("format") != FORMAT:
            raise ModelError(f"{file}: format {facts.get('format')!r}, expected {FORMAT!r}")
        if ranges.shape != (3, 2) or not (ranges[:, 0] < ranges[:, 1]).all():
            raise ModelError(f"{file}: its trained range is no range of three angles; {EXPORT_AGAIN}")
        found = {name: (kind, shape) for name, kind, shape in values}
        for name, shape in SHAPES.items():
            optional = name == "confidence" and name not in found
            if not optional and found.get(name) != ("tensor(float)", shape):
                raise ModelError(f"{file}: {name} is not float [N{''.join(f', {n}' for n in shape)}]")
        self.outputs = [value.name for value in session.get_outputs() if value.name in SHAPES]
        self.range_deg = ranges
        self.trained_subjects = subjects
        self.pose_zero: str | None = facts.get("pose_zero")
        self.takes_partial = facts.get("partial") is True

    def __call__(self, points: np.ndarray) -> dict[str, np.ndarray]:
        """By the name of its output. points: float32 [N, 468, 3], N at most BATCH. ModelError: it fails."""
        try:
            values = self._session.run(self.outputs, {"landmarks": points})
        except _faults() as error:
            raise ModelError(
                f"{self.file}: fails on landmarks ({type(error).__name__}); {EXPORT_AGAIN}"
            ) from error
        if any(len(value) != len(points) for value in values):
            raise ModelError(f"{self.file}: gives another number of poses than of faces; {EXPORT_AGAIN}")
        return dict(zip(self.outputs, values, strict=True))


def _open(file: Path, content: bytes, threads: int) -> Any:
    try:
        import onnxruntime as ort
    except ImportError as error:
        from downstream_hpe.release import install

        raise ModelError(f"onnxruntime is not installed: {install('pose')}") from error
    reason = onnx_file.fault(content)
    if reason is not None:
        raise ModelError(f"{file}: not a readable ONNX model of this program ({reason})")
    options = ort.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 4
    try:
        # Without the fallback, which prints the error, names of the file's and all, and fails again.
        return ort.InferenceSession(
            content, options, providers=["CPUExecutionProvider"], enable_fallback=False
        )
    except _faults() as error:
        # Its own text is long and speaks of its source files; the cause keeps it.
        reason = f"onnxruntime {ort.__version__} refuses it: {type(error).__name__}"
        opset, ir_version = onnx_file.versions(content)
        if opset > onnx_file.OPSET or ir_version > onnx_file.IR_VERSION:
            reason += f"; operator set {opset} or IR version {ir_version} may be too new for it"
        raise ModelError(f"{file}: not a readable ONNX model ({reason}); {EXPORT_AGAIN}") from error


def _faults() -> tuple[type[Exception], ...]:
    """What onnxruntime raises; its exceptions have no base of their own."""
    from onnxruntime.capi import onnxruntime_pybind11_state as faults

    theirs = [e for e in vars(faults).values() if isinstance(e, type) and issubclass(e, Exception)]
    return (*theirs, RuntimeError, MemoryError, UnicodeDecodeError)
