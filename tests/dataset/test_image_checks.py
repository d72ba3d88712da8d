# SPDX-License-Identifier: GPL-3.0-or-later
"""Of every row whose image is wrong something is said, not of the first alone."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import small_dataset

from generator.dataset.format.columns import ImageMode
from generator.dataset.format.part import read_part
from generator.dataset.proof.context import RowContext
from generator.dataset.proof.row_checks import image_problems

ROWS = len(small_dataset.SMALL_PLAN)


def problems_of(root: Path, mode: ImageMode, **columns: list[str]) -> list[str]:
    """Of the first head's rows, with other columns."""
    parts = sorted(root.glob("data/*/part-s1-*.parquet"))
    [batch] = pa.concat_tables(map(read_part, parts)).combine_chunks().to_batches()
    for name, values in columns.items():
        batch = small_dataset.replaced(batch, name, pa.array(values))
    context = RowContext(root, mode, np.empty(0), expected_view=lambda head, pose: None)  # type: ignore[arg-type,return-value]
    return list(image_problems(batch, context))


@pytest.fixture
def root(tmp_path: Path) -> Path:
    small_dataset.build_dataset(tmp_path / "d")
    return tmp_path / "d"


def test_images_where_none_belong(root: Path) -> None:
    assert problems_of(root, "files") == []
    said = problems_of(root, "files", image_path=["images/x.png"] * ROWS)
    assert len(said) == ROWS and all("is not where its image belongs" in one for one in said)
    said = problems_of(root, "none")
    assert len(said) == ROWS and all("although images = none" in one for one in said)


def test_images_that_are_gone_or_links(root: Path) -> None:
    first, second, third, fourth, *_ = sorted((root / "images/s1/neutral").iterdir())
    first.unlink()
    third.unlink()
    for picture in (second, fourth):
        picture.rename(root.parent / picture.name)
        picture.symlink_to(root.parent / picture.name)
    said = sorted(problems_of(root, "files"))
    assert sum("No such file" in one for one in said) == 2 and len(said) == 4
