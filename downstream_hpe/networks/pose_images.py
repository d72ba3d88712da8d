# SPDX-License-Identifier: MIT
"""The images of a dataset and their poses as a torch Dataset: for workers, samplers and transforms."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.dataset as ds
import torch
from PIL import Image
from torch.utils.data import Dataset

from downstream_hpe.errors import DataError
from downstream_hpe.prediction.pictures import read_bgr
from downstream_hpe.tables.columns import (
    ANGLE_COLUMNS,
    HEAD_COLUMNS,
    angles_of,
    check_columns,
    check_rows,
    column,
    landmarks_of,
    vectors,
)
from downstream_hpe.tables.open import open_tables

_FILES = "build with --images files, or stream `headturn export --format webdataset`"


class PoseImages(Dataset[dict[str, Any]]):
    """One item a row, in the order of the files, also where no face was found: its label is exact.

        images = PoseImages("dataset", "train", transform)
        loader = DataLoader(images, batch_size=64, shuffle=True, num_workers=4)

    An item:

    image        what transform makes of the picture; without one float32 [3, H, W], RGB, 0 to 1
    rotation     float32 [3, 3], R_C; ypr_deg float32 [3]
    camera       float32 [3, 3], K; translation_mm float32 [3], the pivot in frame C
    detected     bool; head "subject/expression"
    landmarks    float32 [468, 3], isotropic pixels, frame C, NaN where no face was found; only if asked for

    Labels are in memory; of landmarks 5.6 KB a row. Pictures are read when they are asked for, by workers.
    Whatever draws at random should ask torch, which each worker seeds differently.
    """

    def __init__(
        self,
        path: Path | str,
        split: str | None = None,
        transform: Callable[[Image.Image], Any] | None = None,
        item_transform: Callable[[dict[str, Any]], dict[str, Any]] | None = None,
        landmarks: bool = False,
    ) -> None:
        """path: the folder of a dataset with images as files. split: only its rows; None: all.

        transform: takes the picture, Pillow's, RGB, as torchvision's do. It must not mirror or turn it: that
            changes the pose. item_transform: takes the whole item, and may, if it changes the pose as well.

        Raises
        ------
        DataError: as :func:`downstream_hpe.tables.open.open_tables`; no such row; images that are not files;
            a row whose rotation is not that of its angles.
        """
        self._root, self._transform, self._item_transform = Path(path), transform, item_transform
        columns = [*HEAD_COLUMNS, "split", *ANGLE_COLUMNS, "rotation", "camera", "translation_mm"]
        columns += ["detected", "landmarks"]
        tables = open_tables(path, columns)
        columns.append("image_path")
        for file in tables.files:
            check_columns(file.path, file.physical_schema, columns, _FILES)
        parts: dict[str, list[np.ndarray]] = {}
        for batch in tables.batches(columns, None if split is None else ds.field("split") == split):
            check_rows(tables.path, batch)
            subjects, expressions = column(batch, "subject"), column(batch, "expression")
            values = {
                "head": np.array([f"{s}/{e}" for s, e in zip(subjects, expressions, strict=True)]),
                "image_path": np.array(column(batch, "image_path"), dtype=np.str_),
                "rotation": vectors(batch, "rotation", 9).astype(np.float32).reshape(-1, 3, 3),
                "ypr_deg": angles_of(batch).astype(np.float32),
                "camera": vectors(batch, "camera", 9).astype(np.float32).reshape(-1, 3, 3),
                "translation_mm": vectors(batch, "translation_mm", 3).astype(np.float32),
                "detected": column(batch, "detected").astype(bool),
                **({"landmarks": landmarks_of(batch)} if landmarks else {}),
            }
            for name, array in values.items():
                parts.setdefault(name, []).append(array)
        if not parts:
            of = f" of split {split!r}" if split else ""
            raise DataError(f"{path}: no row{of}; nothing to read")
        self._columns = {name: np.concatenate(arrays) for name, arrays in parts.items()}
        self._paths = self._columns.pop("image_path")
        if (self._paths == "").any():
            raise DataError(f"{path}: its images are not files; {_FILES}")

    def __len__(self) -> int:
        return len(self._paths)

    def __getitem__(self, index: int) -> dict[str, Any]:
        """One item. Raises DataError: its picture is not there, damaged, or outside of the dataset."""
        rgb = read_bgr(self._file(str(self._paths[index])))[..., ::-1]
        item: dict[str, Any] = {name: _plain(values[index]) for name, values in self._columns.items()}
        if self._transform is not None:
            item["image"] = self._transform(Image.fromarray(np.ascontiguousarray(rgb)))
        else:
            item["image"] = torch.from_numpy(rgb.transpose(2, 0, 1).astype(np.float32) / 255)
        return item if self._item_transform is None else self._item_transform(item)

    def _file(self, name: str) -> Path:
        file = self._root / name
        if not file.resolve().is_relative_to(self._root.resolve()):
            raise DataError(f"{self._root}: the image {name[:80]!r} lies outside of the dataset")
        return file


def _plain(value: Any) -> Any:
    """What torch puts together to a batch: tensors, text and flags."""
    if isinstance(value, np.ndarray):
        return torch.from_numpy(value.copy())
    return value.item()
