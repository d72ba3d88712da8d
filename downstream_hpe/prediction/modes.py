# SPDX-License-Identifier: MIT
"""Pillow's pictures of any mode as RGB, 8 bits a channel, as large as they are or reduced."""

from __future__ import annotations

import numpy as np
from PIL import Image, ImageCms

from downstream_hpe.prediction.depth import from_floats, from_whole

BAND = 1 << 23
"""Pixels of a large picture, of whole lines, that are reduced at once."""


def rgb_of_mode(image: Image.Image) -> Image.Image:
    """RGB, 8 bits a channel, of a picture of any of Pillow's modes."""
    if image.mode == "F":
        return Image.fromarray(from_floats(np.asarray(image))).convert("RGB")
    if image.mode.startswith("I"):
        values = np.asarray(image)
        # Of 32 bits Pillow has those with a sign alone.
        signed = values.dtype == np.int32 and values.min(initial=0) < 0
        return Image.fromarray(from_whole(values.view(np.uint32) if signed else values)).convert("RGB")
    if image.mode == "LAB":
        profiles = ImageCms.createProfile("LAB"), ImageCms.createProfile("sRGB")
        converted = ImageCms.profileToProfile(image, *profiles, outputMode="RGB")
        if converted is None:
            raise ValueError("no conversion of LAB")
        return converted
    # Of these alone the colours are multiplied by how opaque they are.
    plain = {"RGBa": "RGBA", "La": "LA"}.get(image.mode)
    return (image if plain is None else image.convert(plain)).convert("RGB")


def reduced_rgb(image: Image.Image, step: int) -> Image.Image:
    """As :func:`rgb_of_mode`, so many times smaller, without a second picture of its size in memory."""
    image.load()  # which turns a TIFF upright
    width = -(-image.width // step)
    # What is white among numbers of more than 8 bits all of them say together.
    deep = image.mode.startswith(("I", "F"))
    small = Image.new(image.mode if deep else "RGB", (width, -(-image.height // step)))
    lines = max(1, BAND // (step * image.width)) * step
    for top in range(0, image.height, lines):
        band = image.crop((0, top, image.width, min(top + lines, image.height)))
        size = (width, -(-band.height // step))
        reduced = (band if deep else rgb_of_mode(band)).resize(size, Image.Resampling.BOX)
        small.paste(reduced, (0, top // step))
    return rgb_of_mode(small) if deep else small
