# SPDX-License-Identifier: GPL-3.0-or-later
"""What a camera does to light, in the order in which it happens; see docs/variety.md.

In linear light: exposure and white balance, defocus, motion, the sensor's own resolution, noise. Then the
tone curve, eight bits, and JPEG. Every step is left out where its setting is the default.
"""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np

from generator.plan.render_settings import NO_JPEG, Sensor

GREY = 0.18
"""Linear light of a middle grey, at which noise is said."""

SHOT = 0.5
"""Share of the noise's variance at middle grey that grows with the light, as photons arrive; the rest is read
noise, the same everywhere."""

OVERSAMPLED = 8
"""Samples a pixel's side of the kernels of defocus and motion."""


STEPS = 1 << 16
"""Of linear light, when it becomes bytes: the darkest byte of sRGB is twenty of them."""


def developed(image: np.ndarray, sensor: Sensor, seed: int) -> np.ndarray:
    """An image as a camera gives it, uint8 [H, W, 3], RGB in sRGB; the very image where nothing is set.

    image: [H, W, 3], RGB, as rendered: uint8, sRGB, or float32, linear. seed: of the noise, which is the same
    for the same seed.
    """
    if sensor.is_plain:
        return image if image.dtype == np.uint8 else to_bytes(image)
    light = _to_linear()[image] if image.dtype == np.uint8 else image
    gains = np.exp2(sensor.exposure_ev + np.array([0.5, 0.0, -0.5]) * sensor.warmth)
    height, width = light.shape[:2]
    light = (light.reshape(height, -1) * np.tile(gains.astype(np.float32), width)).reshape(light.shape)
    if sensor.defocus_px > 0:
        light = cv2.filter2D(light, -1, disc(sensor.defocus_px), borderType=cv2.BORDER_REPLICATE)
    if sensor.motion_px > 0:
        kernel = streak(sensor.motion_px, sensor.motion_deg)
        light = cv2.filter2D(light, -1, kernel, borderType=cv2.BORDER_REPLICATE)
    if sensor.detail < 1:
        light = _coarser(light, sensor.detail)
    if sensor.noise > 0:
        grain = noise_sd(light, sensor.noise)
        grain *= normal(light.shape, seed)
        light = light + grain
    picture = to_bytes(light, sensor.contrast)
    return picture if sensor.jpeg >= NO_JPEG else _through_jpeg(picture, round(sensor.jpeg))


def softened(alpha: np.ndarray) -> np.ndarray:
    """Coverage [H, W] with edges as wide as those of a denoised image: each pixel and its neighbours, 1:2:1
    along each side.

    A denoiser knows colours alone. One sample a pixel has a coverage of 0 or 1, and a head laid over what is
    bright would get a dark rim.
    """
    around = np.array([0.25, 0.5, 0.25], dtype=np.float32)
    return cv2.sepFilter2D(alpha.astype(np.float32), -1, around, around, borderType=cv2.BORDER_REPLICATE)


def noise_sd(light: np.ndarray, noise: float) -> np.ndarray:
    """Standard deviation of the noise at linear light [...]: noise at middle grey.

    The usual model of a sensor: a variance that grows with the light, and one that does not (Foi et al.,
    "Practical Poissonian-Gaussian noise modeling and fitting", IEEE TIP 17(10), 2008).
    """
    deviation = np.maximum(light, 0)
    deviation *= SHOT / GREY
    deviation += 1 - SHOT
    np.sqrt(deviation, out=deviation)
    deviation *= noise
    return deviation


def toned(display: np.ndarray, contrast: float) -> np.ndarray:
    """An S-curve over sRGB values 0-1 [...]: x + contrast x (1 - x) (2x - 1), monotone from -1 to 1."""
    return display + np.float32(contrast) * display * (1 - display) * (2 * display - 1)


def to_srgb(light: np.ndarray) -> np.ndarray:
    """Linear light as sRGB, 0-1 [...]; what is brighter is clipped (IEC 61966-2-1)."""
    clipped = np.clip(light, 0, 1)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055)


def to_bytes(light: np.ndarray, contrast: float = 0.0) -> np.ndarray:
    """Linear light, float32 [...], as bytes of sRGB, uint8 [...], :func:`toned`."""
    display = toned(_steps(), contrast) if contrast else _steps()
    of_step = np.rint(display * 255).astype(np.uint8)
    step = np.clip(light, 0, 1)
    step *= STEPS - 1
    step += 0.5
    return of_step[step.astype(np.uint16)]


@lru_cache(maxsize=1)
def _steps() -> np.ndarray:
    """The sRGB value of each of STEPS of linear light, float32 [STEPS]."""
    return to_srgb(np.arange(STEPS) / (STEPS - 1)).astype(np.float32)


@lru_cache(maxsize=1)
def _to_linear() -> np.ndarray:
    """Linear light of each sRGB byte, float32 [256]."""
    return to_linear(np.arange(256) / 255)


def to_linear(display: np.ndarray) -> np.ndarray:
    """sRGB as linear light, float32 [...]: of bytes, or of values 0-1 (IEC 61966-2-1)."""
    if display.dtype == np.uint8:
        return _to_linear()[display]
    light = np.where(display <= 0.04045, display / 12.92, ((display + 0.055) / 1.055) ** 2.4)
    return light.astype(np.float32)


@lru_cache(maxsize=64)
def disc(radius_px: float) -> np.ndarray:
    """A disc of light, what defocus makes of a point: float32 [k, k], sum 1."""
    x, y = _grid(radius_px)
    return _shrunk((x**2 + y**2 <= radius_px**2).astype(np.float64))


@lru_cache(maxsize=64)
def streak(length_px: float, angle_deg: float) -> np.ndarray:
    """A line of light, one pixel wide, what motion makes of a point: float32 [k, k], sum 1.

    angle_deg: 0 is to the right, 90 is up.
    """
    x, y = _grid(length_px / 2 + 1)
    turn = np.deg2rad(angle_deg)
    along, across = x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn)
    return _shrunk(((np.abs(along) <= length_px / 2 + 0.5) & (np.abs(across) <= 0.5)).astype(np.float64))


def _grid(reach_px: float) -> tuple[np.ndarray, np.ndarray]:
    """x and y of samples about the middle of a kernel of odd size that reaches so far, pixels."""
    side = (2 * int(np.ceil(reach_px)) + 1) * OVERSAMPLED
    axis = (np.arange(side) + 0.5 - side / 2) / OVERSAMPLED
    x, y = np.meshgrid(axis, axis)
    return x, y


def _shrunk(samples: np.ndarray) -> np.ndarray:
    side = len(samples) // OVERSAMPLED
    kernel = samples.reshape(side, OVERSAMPLED, side, OVERSAMPLED).mean(axis=(1, 3))
    return (kernel / kernel.sum()).astype(np.float32)


def normal(shape: tuple[int, ...], seed: int) -> np.ndarray:
    """Numbers with a standard deviation of 1, float32 [shape], the same for the same seed. OpenCV draws them
    in a third of numpy's time."""
    cv2.setRNGSeed(seed % (1 << 31))
    numbers = np.empty((shape[0], int(np.prod(shape[1:]))), np.float32)
    cv2.randn(numbers, np.zeros(1), np.ones(1))
    return numbers.reshape(shape)


def _coarser(light: np.ndarray, detail: float) -> np.ndarray:
    """An image of fewer pixels, enlarged again."""
    height, width = light.shape[:2]
    small = (max(1, round(width * detail)), max(1, round(height * detail)))
    coarse = cv2.resize(light, small, interpolation=cv2.INTER_AREA)
    return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_LINEAR)


def _through_jpeg(picture: np.ndarray, quality: int) -> np.ndarray:
    _, data = cv2.imencode(
        ".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, quality]
    )
    return cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_COLOR), cv2.COLOR_BGR2RGB)
