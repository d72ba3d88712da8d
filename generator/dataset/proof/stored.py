# SPDX-License-Identifier: GPL-3.0-or-later
"""The image and the passes that a dataset holds of a row: decoded, measured, hashed as they are now."""

from __future__ import annotations

import hashlib
import io
import struct
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from generator.dataset.format.columns import ImageMode
from generator.dataset.format.open import stored_bytes
from generator.dataset.format.passes import passes_sha256, read_channels
from generator.dataset.proof.compare import StoredFile
from generator.errors import DatasetError, UsageError
from generator.names import as_inside_path, inside
from generator.plan.settings import Dataset
from generator.registries import PASSES

_KINDS = {"png": "PNG", "jpg": "JPEG"}
"""Of the setting dataset.image_format: Pillow's name."""


@dataclass
class Stored:
    """What there is of one row.

    problems: a line each, with the file's name. image: its bytes, None without one that can be read.
    image_name, passes_name: for people; "" where there is none. passes: their SHA-256, "" without.
    decoded: was there an image, and is it one of the right kind and size?
    """

    image_name: str = ""
    image: bytes | None = None
    decoded: bool = False
    passes_name: str = ""
    passes: str = ""
    problems: list[str] = field(default_factory=list)

    def compared(self) -> str:
        """What is compared with what, for people."""
        image, passes = (
            f"{name}, its recorded hash and {what}"
            for name, what in ((self.image_name, "the new image"), (self.passes_name, "the new passes"))
        )
        if not self.image_name:
            image = "the recorded hash and the new image; no image is stored (images = none)"
        return f"compared: {image}" + f"; {passes}" * bool(self.passes_name)

    def files(self, new_image: bytes, row: Mapping[str, Any]) -> dict[str, StoredFile]:
        """What :func:`generator.dataset.proof.compare.row_differences` compares with the new image."""
        found = {}
        if self.image is not None:
            detail = partial(_apart, self.image, new_image, row)
            sha256 = hashlib.sha256(self.image).hexdigest()
            found["image_sha256"] = StoredFile(self.image_name, sha256, detail)
        if self.passes:
            found["passes_sha256"] = StoredFile(self.passes_name, self.passes)
        return found


def read_stored(root: Path, row: Mapping[str, Any], images: ImageMode, wanted: Dataset) -> Stored:
    """Read what is stored of a row, and check it against its row and the recorded configuration.

    Never raises for what is wrong with the files: that is in problems.
    """
    stored = Stored()
    if images != "none":
        stored.image_name = row["image_path"] or f"the embedded image of {row['sample_id']}"
        try:
            stored.image, _ = stored_bytes(root, row)
            decoded(stored.image, row, wanted.image_format)
            stored.decoded = True
        except DatasetError as error:
            stored.problems.append(str(error))
        except ValueError as error:
            stored.problems.append(f"{stored.image_name} {error}")
    channels = {channel for name in wanted.passes for channel in PASSES.get(name).channel_names}
    path = row["passes_path"]
    if not path:
        if channels:
            stored.problems.append(f"{row['sample_id']} has no passes, the configuration asks for some")
        return stored
    stored.passes_name = path
    try:
        found = read_channels(inside(root, as_inside_path(path)))
    except ValueError as error:
        stored.problems.append(f"passes_path {path!r} {error}")
    except (DatasetError, UsageError) as error:
        stored.problems.append(str(error))
    else:
        stored.passes = passes_sha256(found)
        size = (row["height"], row["width"])
        if set(found) != channels:
            stored.problems.append(
                f"{path} has the channels {', '.join(sorted(found))}, expected {', '.join(sorted(channels))}"
            )
        if any(values.shape != size for values in found.values()):
            stored.problems.append(f"{path} has not the size of the image")
    return stored


def decoded(image: bytes, row: Mapping[str, Any], kind: str | None = None) -> np.ndarray:
    """The pixels of an image of a row, uint8 [H, W, 3], RGB. kind: of dataset.image_format, if it must be it.

    Its header is compared with the row before anything is decoded, so it can be no larger than that.
    Raises ValueError, with what is wrong as the end of a sentence.
    """
    kinds = list(_KINDS.values()) if kind is None else [_KINDS[kind]]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            with Image.open(io.BytesIO(image), formats=kinds) as picture:
                (width, height), mode = picture.size, picture.mode
                if (width, height) == (row["width"], row["height"]) and mode == "RGB":
                    return np.asarray(picture)
    except (Image.DecompressionBombError, Image.DecompressionBombWarning) as error:
        raise ValueError("is larger than any image of a dataset") from error
    except (OSError, SyntaxError, ValueError, EOFError, struct.error) as error:
        raise ValueError(f"is no {' or '.join(kinds)} that can be decoded") from error
    if mode != "RGB":
        raise ValueError(f"has the channels {mode}, expected RGB")
    raise ValueError(f"has {width} x {height} pixels, its row says {row['width']} x {row['height']}")


def _apart(then: bytes, now: bytes, row: Mapping[str, Any]) -> str:
    """How far two images are apart."""
    try:
        difference = np.abs(decoded(now, row).astype(int) - decoded(then, row))
    except ValueError:
        return ""  # which of the two is none is a problem of its own
    share = (difference.max(axis=2) > 0).mean()
    return f": up to {difference.max()} of 255 levels, on {share:.2%} of its pixels"
