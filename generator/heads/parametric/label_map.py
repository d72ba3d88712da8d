# SPDX-License-Identifier: GPL-3.0-or-later
"""What every texel of a parametric head's skin.png is: the classes of the pass ``segmentation``."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image

from generator.errors import HeadError
from generator.heads.card import CARD_NAME, MAX_CARD_BYTES
from generator.heads.head import Head
from generator.heads.parametric.appearance import Appearance
from generator.heads.parametric.atlas import Atlas, head_atlas
from generator.heads.parametric.facial_hair import HALF, beard_texels, brow_texels
from generator.heads.parametric.hair import hair_texels
from generator.labels import BEARD, BROWS, EYES, HAIR, LABELS, LIPS, SKIN, TEETH
from generator.reading import parse_json, read_limited


def label_texels(atlas: Atlas, look: Appearance) -> np.ndarray:
    """Places in LABELS, uint8 [H, W]: as the layers of paint lie. What is in the mouth is teeth."""
    classes = np.full(atlas.part.shape, LABELS.index(SKIN), dtype=np.uint8)
    classes[atlas.lips > HALF] = LABELS.index(LIPS)
    flat = classes.reshape(-1)
    for label, where in (
        (BEARD, beard_texels(atlas, look)),
        (BROWS, brow_texels(atlas, look)),
        (HAIR, hair_texels(atlas, look)),
    ):
        flat[where] = LABELS.index(label)
    classes[atlas.is_part("socket_left", "socket_right")] = LABELS.index(EYES)
    classes[atlas.is_part("mouth", "upper_teeth", "lower_teeth", "tongue")] = LABELS.index(TEETH)
    return classes


def write_label_map(head: Head, target: Path) -> None:
    """Write the classes of a head's skin.png as an image. HeadError: its card does not say enough."""
    card = head.mesh_path.with_name(CARD_NAME)
    try:
        said = parse_json(read_limited(card, MAX_CARD_BYTES))["parameters"]["appearance"]
        look = Appearance(**said)
        classes = label_texels(head_atlas(), look)
    except (OSError, ValueError, KeyError, TypeError, json.JSONDecodeError) as error:
        raise HeadError(f"{card}: does not say how the head was painted; have it made again") from error
    Image.fromarray(classes).save(target)
