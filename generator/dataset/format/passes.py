# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of an image as multilayer OpenEXR, with the same names whatever Blender made them.

Linear, frame C, metres; see docs/passes.md.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from generator.dataset.format.files import one_line
from generator.errors import DatasetError, UsageError, WorkerError
from generator.exr_header import check_exr
from generator.plan.passes import OBJECT_INDEX, Pass
from generator.process import native_silence
from generator.registries import PASSES

_HEADER = {
    "headturn.frame": "C (camera): x image-right, y image-down, z into the scene",
    "headturn.units": "depth and position in metres; normal of length 1; no surface is NaN",
}


def passes_from_blender(path: Path, passes: Sequence[str], distance_mm: float) -> dict[str, np.ndarray]:
    """What Blender wrote, in frame C and metres: {"depth.Z": float32 [H, W], ...}.

    passes: those of the registry :data:`generator.registries.PASSES` that are wanted.
    distance_mm: camera to pivot. Pixels without a surface hold what the pass says, mostly NaN.
    Raises WorkerError if a pass is not in the file, UsageError if there is no such pass.
    """
    layers = _layers(read_channels(path))
    nothing = _layer(OBJECT_INDEX, layers, path)[..., 0] == 0
    made: dict[str, np.ndarray] = {}
    for name in passes:
        wanted: Pass = PASSES.get(name)
        values = _layer(wanted, layers, path)
        if wanted.turned:
            x, y, z = np.moveaxis(values, -1, 0)
            values = np.stack([x, -z, y], axis=-1)  # frame B to frame C
        if wanted.from_pivot:
            values[..., 2] += np.float32(distance_mm * 1e-3)
        values = np.where(nothing[..., None], np.float32(wanted.empty), values)
        for place, channel in enumerate(wanted.channel_names):
            made[channel] = np.ascontiguousarray(values[..., place])
    return made


def _layer(wanted: Pass, layers: Mapping[str, Mapping[str, np.ndarray]], path: Path) -> np.ndarray:
    """The channels of a pass as Blender wrote them, float32 [H, W, channels]."""
    for alias in wanted.layers:
        if alias in layers:
            channels = layers[alias]
            keys = [next((name for name in names if name in channels), "") for names in wanted.axes]
            if all(keys):
                return np.stack([channels[key] for key in keys], axis=-1).astype(np.float32)
    raise WorkerError(f"{path}: no pass {wanted.name!r} among {', '.join(sorted(layers))}")


def write_passes(channels: Mapping[str, np.ndarray], path: Path) -> None:
    """Write channels as OpenEXR with ZIP compression; the same channels give the same bytes."""
    exr = _openexr()
    header: dict[str, Any] = {"compression": exr.ZIP_COMPRESSION, "type": exr.scanlineimage, **_HEADER}
    with exr.File(header, {name: channels[name] for name in sorted(channels)}) as file:
        file.write(str(path))


def read_channels(path: Path) -> dict[str, np.ndarray]:
    """Every channel of an OpenEXR by its full name, float32 [H, W].

    Raises DatasetError if the file is missing, damaged or no OpenEXR.
    """
    exr = _openexr()
    if not path.exists():
        raise DatasetError(f"{path}: is missing; run `headturn build` again")
    try:
        check_exr(path)
        # It says on stdout what it could not decode, and leaves that out.
        with native_silence(1, 2), exr.File(str(path), separate_channels=True) as file:
            # Blender 5 writes a part a pass, 4.x one part with all of them.
            parts = [part.channels for part in file.parts]
            channels = {name: np.array(found.pixels) for part in parts for name, found in part.items()}
        if not all(values.ndim == 2 and values.dtype.kind == "f" for values in channels.values()):
            raise ValueError("a channel is missing or cut off")
        return channels
    except OSError as error:
        raise DatasetError(
            f"{path}: cannot be read ({error.strerror}); run `headturn build` again"
        ) from error
    # Its library raises what it likes at a damaged file.
    except (RuntimeError, ValueError, TypeError, LookupError, ArithmeticError, MemoryError) as error:
        raise DatasetError(
            f"{path}: not a readable OpenEXR; run `headturn build` again ({one_line(error)})"
        ) from error


def passes_sha256(channels: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of the decoded floats: each channel's name and little-endian float32, sorted by name."""
    digest = hashlib.sha256()
    for name in sorted(channels):
        values = np.array(channels[name], dtype="<f4")
        values[np.isnan(values)] = np.nan
        digest.update(f"{name}:{values.shape[0]}x{values.shape[1]}\n".encode())
        digest.update(values.tobytes())
    return digest.hexdigest()


def _layers(channels: Mapping[str, np.ndarray]) -> dict[str, dict[str, np.ndarray]]:
    """Channels by the name of their pass: "ViewLayer.Depth.Z" is layer Depth, channel Z."""
    layers: dict[str, dict[str, np.ndarray]] = {}
    for name, values in channels.items():
        *_, layer, channel = ("", *name.split("."))
        layers.setdefault(layer, {})[channel] = values
    return layers


def _openexr() -> Any:
    try:
        import OpenEXR
    except ImportError as error:
        raise UsageError(
            f"passes need the OpenEXR package ({error}): pip install 'headturn[build]'"
        ) from error
    return OpenEXR
