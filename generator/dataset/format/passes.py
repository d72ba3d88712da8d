# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of an image as multilayer OpenEXR, with the same names whatever Blender made them.

Linear, frame C, metres; see docs/passes.md.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from generator.dataset.format.files import one_line
from generator.errors import DatasetError, UsageError, WorkerError
from generator.exr_header import check_exr
from generator.heads.scene import Eye
from generator.labels import LABELS
from generator.plan.passes import (
    ALBEDO,
    DEPTH,
    LABELS_A_PICTURE,
    OBJECT_INDEX,
    PAINTED,
    SEGMENTATION,
    Pass,
    painted_file,
)
from generator.process import native_silence
from generator.registries import PASSES
from litert_faces.installing import install_command

COVERAGE = 1e-3
"""How near the classes of a pixel add up to what they cover."""

ALBEDO_OF_SCENES = "Denoising Albedo"
"""Cycles' name of the layer."""

_HEADER = {
    "headturn.frame": "C (camera): x image-right, y image-down, z into the scene",
    "headturn.units": "depth and position in metres; normal of length 1; no surface is NaN",
}


def passes_from_blender(
    path: Path, passes: Sequence[str], distance_mm: float, eye: Eye | None = None
) -> dict[str, np.ndarray]:
    """What Blender wrote, in frame C and metres: {"depth.Z": float32 [H, W], ...}.

    passes: those of the registry :data:`generator.registries.PASSES` that are wanted.
    distance_mm: camera to pivot. eye: the camera in the world of a scene; without it the head stands alone
    in front of it, in frame B, its pivot at the origin. Pixels without a surface hold what the pass says,
    mostly NaN.
    Raises WorkerError if a pass is not in the file, UsageError if there is no such pass.
    """
    layers = _layers(read_channels(path))
    nothing = _layer(OBJECT_INDEX, layers, path)[..., 0] == 0
    made: dict[str, np.ndarray] = {}
    for name in passes:
        wanted: Pass = PASSES.get(name)
        if wanted.switch == PAINTED:
            made |= PAINTERS[name](path)
            continue
        values = _layer(wanted, layers, path)
        if eye is not None:
            values = _of_scene(values, wanted, eye)
        elif wanted.turned:
            x, y, z = np.moveaxis(values, -1, 0)
            values = np.stack([x, -z, y], axis=-1)  # frame B to frame C
        if wanted.from_pivot and eye is None:
            values[..., 2] += np.float32(distance_mm * 1e-3)
        values = np.where(nothing[..., None], np.float32(wanted.empty), values)
        for place, channel in enumerate(wanted.channel_names):
            made[channel] = np.ascontiguousarray(values[..., place])
    return made


def _of_scene(values: np.ndarray, wanted: Pass, eye: Eye) -> np.ndarray:
    """What Blender wrote of a scene, in frame C and metres."""
    if wanted.from_pivot:
        found = eye.points(values.astype(np.float64)) * 1e-3
    elif wanted.turned:
        found = eye.directions(values.astype(np.float64))
    elif wanted.switch == DEPTH.switch:
        found = values * (eye.mm * 1e-3)
    else:
        return values
    return found.astype(np.float32)


def _albedo(path: Path) -> dict[str, np.ndarray]:
    """Colour without light where there is a surface: rendered over nothing it is multiplied by coverage."""
    *color, cover = _painted(path.with_name(painted_file(path.stem, ALBEDO.name)))
    there = cover > 0
    mean = [np.where(there, value / np.where(there, cover, 1), np.float32(np.nan)) for value in color]
    return dict(zip(ALBEDO.channel_names, mean, strict=True))


def _segmentation(path: Path) -> dict[str, np.ndarray]:
    """Share of each pixel that each class covers. Raises WorkerError where they do not add up."""
    classes: list[np.ndarray] = []
    groups = range(len(LABELS) // LABELS_A_PICTURE)
    files = [path.with_name(painted_file(path.stem, SEGMENTATION.name, group)) for group in groups]
    pictures = [_painted(file) if file.exists() else None for file in files]
    found = [picture for picture in pictures if picture]
    if not found:
        raise WorkerError(f"{path}: the render worker left no segmentation")
    total = found[0][-1]
    for picture in pictures:
        classes += picture[:-1] if picture else [np.zeros_like(total)] * LABELS_A_PICTURE
    if np.abs(sum(classes) - total).max() > COVERAGE:
        raise WorkerError(f"{path}: a class of the segmentation is missing")
    return dict(zip(SEGMENTATION.channel_names, [1 - total, *classes], strict=True))


PAINTERS: dict[str, Callable[[Path], dict[str, np.ndarray]]] = {
    ALBEDO.name: _albedo,
    SEGMENTATION.name: _segmentation,
}
"""How painted passes are read."""


def _painted(path: Path) -> list[np.ndarray]:
    """R, G, B and A of what a render worker painted, float32 [H, W]; the file is removed."""
    layers = _layers(read_channels(path))
    path.unlink()
    if ALBEDO_OF_SCENES in layers:
        channels = {**layers[ALBEDO_OF_SCENES], "A": layers["Combined"]["A"]}
    else:
        [channels] = layers.values()
    return [channels[name].astype(np.float32) for name in "RGBA"]


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
        raise UsageError(f"passes need the OpenEXR package ({error}): {install_command('build')}") from error
    return OpenEXR
